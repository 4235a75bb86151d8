"""The figures of a sweep: learning curves, quality of the explanations, and final values."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ibe_rl.apps.plot_style import DARK, FAINT, grid, hexed, interval
from ibe_rl.apps.sweep.records import COLUMN_LABELS
from ibe_rl.view.palette import RUN_COLOURS

_LINES = ("-", "--", ":")
_MARKED_POINTS = 15


def _style(number: int) -> dict[str, Any]:
    """Colour and line of a condition."""
    return {
        "color": hexed(RUN_COLOURS[number % len(RUN_COLOURS)]),
        "linestyle": _LINES[number // len(RUN_COLOURS) % len(_LINES)],
    }


@rc_context(DARK)
def curves(conditions: list[dict[str, Any]], columns: dict[str, str]) -> Figure:
    """Columns over the frames: interquartile means over the runs, with 95 % intervals."""
    shown = {column: title for column, title in columns.items() if any(column in one["curves"] for one in conditions)}
    rows = max(1, -(-len(shown) // 2))
    figure, axes = grid(rows, 2, 11, 3.1 * rows + 0.5 + 0.1 * len(conditions))
    panels = [axis for row in axes for axis in row]
    for axis, (column, title) in zip(panels, shown.items(), strict=False):
        for number, one in enumerate(conditions):
            if column in one["curves"]:
                _curve(axis, one["curves"][column], number, several=one["runs"] > 1)
        axis.set_title(title)
    for axis in panels[max(0, len(shown) - 2) : len(shown)]:
        axis.set_xlabel("thousand frames")
    for axis in panels[len(shown) :]:
        axis.set_visible(False)
    for number, one in enumerate(conditions):
        panels[0].plot([], [], label=_label(one), **_style(number))
    figure.legend(loc="outside lower center", ncols=2 if len(conditions) < 9 else 3)
    return figure


def _curve(axis: Axes, curve: dict[str, list[float]], number: int, several: bool) -> None:
    frames = np.array(curve["frames"]) / 1000
    marker = "o" if len(frames) <= _MARKED_POINTS else ""
    axis.plot(frames, curve["value"], linewidth=1.6, marker=marker, markersize=4, **_style(number))
    if several:
        axis.fill_between(frames, curve["low"], curve["high"], color=_style(number)["color"], alpha=0.18, linewidth=0)


def _label(condition: dict[str, Any]) -> str:
    return f"{condition['name']} ({condition['runs']} {'run' if condition['runs'] == 1 else 'runs'})"


@rc_context(DARK)
def ends(conditions: list[dict[str, Any]], columns: list[str]) -> Figure:
    """Final values by condition: every run, the interquartile mean and its interval."""
    figure, axes = grid(1, len(columns), 2.0 + 1.8 * len(columns), 1.1 + 0.36 * len(conditions), sharey=True)
    for axis, column in zip(axes[0], columns, strict=True):
        for row, one in enumerate(conditions):
            if column in one["ends"]:
                _end(axis, one["ends"][column], row)
        axis.set_title(_broken(COLUMN_LABELS[column]), fontsize=9)
    axes[0][0].set_yticks(range(len(conditions)), [_label(one) for one in conditions])
    axes[0][0].set_ylim(len(conditions) - 0.5, -0.5)
    return figure


def _end(axis: Axes, end: dict[str, Any], row: int) -> None:
    axis.plot(end["each"], [row + 0.22] * len(end["each"]), ".", color=FAINT, markersize=5)
    interval(axis, end, row, _style(row)["color"], alpha=1.0)


def _broken(title: str) -> str:
    """A title broken into two lines of about the same length."""
    words = title.split()
    best = min(range(1, len(words) + 1), key=lambda n: max(len(" ".join(words[:n])), len(" ".join(words[n:]))))
    return "\n".join(part for part in (" ".join(words[:best]), " ".join(words[best:])) if part)
