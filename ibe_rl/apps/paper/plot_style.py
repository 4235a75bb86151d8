"""How the figures of the report look: the dark ground and the colours of the live view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from ibe_rl.apps.paper.foretelling import FLIPPED, NOTHING, PREDICTED, SHUFFLED, STAYS, TRUE_FUTURE
from ibe_rl.apps.paper.words import MINMAX, OURS, PAPER, SIGNS
from ibe_rl.types import Array
from ibe_rl.view import palette as colours


def hexed(colour: Sequence[float] | Array) -> str:
    """A colour of the live view as matplotlib takes it."""
    red, green, blue = (float(each) / 255 for each in colour)
    return to_hex((red, green, blue))


INK, FAINT, LINE = hexed((228, 228, 235)), hexed(colours.AXIS), hexed((44, 46, 58))
DARK: Any = {
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "legend.facecolor"), hexed(colours.BACKGROUND)),
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.titlecolor"), INK),
    **dict.fromkeys(("xtick.color", "ytick.color", "axes.edgecolor"), FAINT),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    **dict.fromkeys(("axes.titlesize", "axes.labelsize"), 10),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 9),
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.7,
    "hatch.color": INK,
}
"""Settings of matplotlib for all figures of the report."""

LABELS = {
    TRUE_FUTURE: "the true future",
    PREDICTED: "the predicted change, without words",
    OURS: "the default vocabulary",
    PAPER: "the paper's vocabulary",
    NOTHING: "no explanation: carries the motion on",
    STAYS: "no explanation: straight down from here",
    SHUFFLED: "taught with shuffled instructions",
    FLIPPED: "the default, left and right swapped",
}
"""Observers, in the order in which they are drawn, to what they are told."""
VARIANTS = {
    PAPER: "the paper's",
    SIGNS: "the paper's split,\nsigns kept",
    MINMAX: "our split,\nmin-max",
    OURS: "our default",
}
"""Kinds of vocabulary to what they are called beside each other."""
SHADES = {
    TRUE_FUTURE: hexed(colours.GREEN),
    PREDICTED: hexed((165, 148, 249)),
    OURS: hexed(colours.EXPLANATION),
    PAPER: hexed(colours.PINK),
    NOTHING: hexed(colours.PALE),
    STAYS: hexed(colours.OTHERS),
    SHUFFLED: hexed(colours.OTHERS),
    FLIPPED: hexed(colours.OTHERS),
}
MARKERS = {
    **dict.fromkeys(LABELS, "o"),
    TRUE_FUTURE: "*",
    OURS: "D",
    PAPER: "s",
    NOTHING: "v",
    STAYS: "^",
    SHUFFLED: "X",
    FLIPPED: "P",
}


def grid(rows: int, columns: int, width: float, height: float, **shared: Any) -> tuple[Figure, list[list[Axes]]]:
    """A figure of the given size in inches with rows of axes."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared).tolist()


def interval(axis: Axes, told: dict[str, Any], y: float, colour: str, marker: str = "o", **more: Any) -> None:
    """A value with its interval, lying; nothing where it is not known."""
    if told["value"] is None:
        return
    if told["low"] is not None:
        axis.plot([told["low"], told["high"]], [y, y], color=colour, linewidth=2.2, alpha=0.8)
    axis.plot([told["value"]], [y], color=colour, marker=marker, markersize=7, linestyle="", **more)
