"""Build the documentation site in build/site.

python -m docs_site         needs the extra `docs`; a warning is an error
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import ibe_rl

ROOT = Path(__file__).parent.parent
DOCS, COPY, SITE = ROOT / "docs", ROOT / "build" / "pages", ROOT / "build" / "site"


def main() -> int:
    """Copy docs/, add what is generated, and build; returns the exit status."""
    stage(DOCS, COPY)
    shutil.rmtree(SITE, ignore_errors=True)
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    return subprocess.run(command, cwd=ROOT, check=False).returncode  # noqa: S603 - our own command


def stage(docs: Path, copy: Path) -> None:
    """The Markdown that the site is built from: docs/, its notebooks as pages, and the reference."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(docs, copy, ignore=shutil.ignore_patterns(".ipynb_checkpoints", "runs", "__pycache__"))
    for notebook in copy.glob("notebooks/*.ipynb"):
        notebook.with_suffix(".md").write_text(as_page(json.loads(notebook.read_text())))
    for page in copy.glob("*.md"):
        page.write_text(page.read_text().replace(".ipynb)", ".md)"))
    (copy / "REFERENCE.md").write_text(reference())


def as_page(notebook: dict[str, Any]) -> str:
    """A notebook's text, code and printed output as Markdown."""
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        printed = "".join(line for output in cell.get("outputs", []) for line in output.get("text", []))
        parts += [f"```text\n{printed.rstrip()}\n```"] if printed else []
    return "\n\n".join(parts) + "\n"


def reference() -> str:
    """A page that shows the docstring of every public name, where the name is defined."""
    lines = ["# Docstrings", "", "Every name that `import ibe_rl` offers, from its docstring."]
    for name in vars(ibe_rl)["__all__"]:
        lines += ["", f"::: {getattr(ibe_rl, name).__module__}.{name}"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
