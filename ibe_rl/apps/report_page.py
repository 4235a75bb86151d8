"""What the reports of the applications share: one page that holds its figures, and numbers with their intervals."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from ibe_rl.evaluation.figures import save
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.storage.run_folder import write_atomically

PAGE = "report.html"


def write_page(
    package: str, folder: Path, figures: Mapping[str, Callable[[], Figure]], **values: Any
) -> tuple[list[Path], Path]:
    """Draw figures and write the page that holds them.

    Args:
        package: whose ``report.html.jinja`` is filled in; it may import ``macros.jinja`` beside this file.
        folder: where the page and the PNG files go.
        figures: names of PNG files to what draws them.
        values: what the template knows beside the figures.

    Returns:
        The PNG files and the page.
    """
    files = []
    with progress_bar("figures", len(figures)) as step:
        for name, draw in figures.items():
            files.append(save(draw(), folder / name))
            step()
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("ibe_rl.apps", "."), PackageLoader(package, ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    encoded = {path.name: base64.b64encode(path.read_bytes()).decode() for path in files}
    text = environment.get_template(f"{PAGE}.jinja").render(**values, encoded=encoded)
    write_atomically(folder / PAGE, lambda stream: stream.write(text.encode()))
    return files, folder / PAGE


def number(estimate: dict[str, Any] | None, digits: int = 2, sign: bool = False) -> str:
    """A value with its interval."""
    if estimate is None or estimate["value"] is None:
        return "-"
    form = f"{'+' if sign else ''}.{digits}f"
    text = f"{estimate['value']:{form}}"
    return text if estimate["low"] is None else f"{text} [{estimate['low']:{form}}, {estimate['high']:{form}}]"
