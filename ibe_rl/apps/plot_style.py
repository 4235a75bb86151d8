"""The plot style of the reports: the dark ground and the colours of the live view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from ibe_rl.task import Shape
from ibe_rl.types import Array
from ibe_rl.view import palette as colours


def hexed(colour: Sequence[float] | Array) -> str:
    """A colour of the live view as matplotlib takes it."""
    return to_hex(tuple((np.asarray(colour, float) / 255).tolist()))


def expression_colours(values: Array) -> list[str]:
    """The colours of expressions ``(N,)``."""
    return [hexed(each) for each in colours.of_expressions(values)]


INK, FAINT, LINE = hexed(colours.WHITE), hexed(colours.AXIS), hexed(colours.GRID)
DARK: Any = {
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "legend.facecolor"), hexed(colours.BACKGROUND)),
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.titlecolor"), INK),
    **dict.fromkeys(("xtick.color", "ytick.color", "axes.edgecolor"), FAINT),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    **dict.fromkeys(("axes.titlesize", "axes.labelsize"), 10),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 9),
    "text.parse_math": False,  # texts of users may hold dollars
    "axes.formatter.useoffset": False,  # a tick says its value, where all of them are nearly the same too
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.7,
    "hatch.color": INK,
}
"""Settings of matplotlib for all figures of a report."""


def grid(rows: int, columns: int, width: float, height: float, **shared: Any) -> tuple[Figure, list[list[Axes]]]:
    """A figure of the given size in inches with rows of axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared).tolist()


def legend_of(axes: Sequence[Axes], figure: Figure, columns: int) -> None:
    """Put the legend of some axes below the whole figure, each label once."""
    pairs = [pair for axis in axes for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    entries = {label: handle for handle, label in pairs}
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)


def draw_shapes(axis: Axes, shapes: Sequence[Shape], width: float, alpha: float) -> None:
    """Draw the outlines of shapes in their colours."""
    lines = [np.concatenate([shape.points, shape.points[:1]]) if shape.closed else shape.points for shape in shapes]
    axis.add_collection(
        LineCollection(lines, colors=[hexed(shape.colour) for shape in shapes], linewidths=width, alpha=alpha)
    )


def interval(
    axis: Axes, estimate: dict[str, Any], y: float, colour: str, marker: str = "o", alpha: float = 0.8
) -> None:
    """A value with its interval, lying; nothing where it is not known."""
    if estimate["value"] is None:
        return
    if estimate["low"] is not None:
        axis.plot([estimate["low"], estimate["high"]], [y, y], color=colour, linewidth=2.2, alpha=alpha)
    axis.plot([estimate["value"]], [y], color=colour, marker=marker, markersize=7, linestyle="")
