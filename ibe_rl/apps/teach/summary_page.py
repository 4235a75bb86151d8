"""The page that sums a lesson up, as one file in the folder of the run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from ibe_rl.storage.run_folder import write_atomically

LESSON_PAGE = "lesson.html"


def write_lesson_page(folder: Path, summary: Mapping[str, Any]) -> Path:
    """Write the summary of a lesson, with its films; returns the file, which any browser opens."""
    part = {
        name: files(__package__).joinpath(name).read_text("utf-8") for name in ("page.css", "shapes.js", "summary.js")
    }
    data = json.dumps(summary, ensure_ascii=False, allow_nan=False).replace(
        "<", "\\u003c"
    )  # no text of a person ends the script
    page = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>The lesson</title><style>{part["page.css"]}</style></head>
<body><h1>The lesson</h1><section id="summary"></section>
<script>{part["shapes.js"]}{part["summary.js"]}showSummary({data});</script></body></html>
"""
    path = folder / LESSON_PAGE
    write_atomically(path, lambda stream: stream.write(page.encode()))
    return path
