"""Episodes of the prediction task as the paper shows them: what was said, what was seen, and what came."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ibe_rl.apps.paper.foretelling import NOTHING, TRUE_FUTURE, Listened, Shown
from ibe_rl.apps.paper.plot_style import DARK, FAINT, INK, LABELS, LINE, MARKERS, SHADES, grid, hexed
from ibe_rl.apps.paper.words import OURS, PAPER
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.ibe import ClusterMapping
from ibe_rl.task import Shape, Task
from ibe_rl.types import Array
from ibe_rl.view import palette as colours

GUESSES = (NOTHING, PAPER, OURS)
EVERY = 4
"""Steps from one outline to the next."""
COLUMNS = 4
ROOM_ABOVE, LINE_APART = 0.12, 0.05
"""Of the scene's height: above the highest point of a path, and from one line of markers to the next."""
BAND_NAMES = {PAPER: "the paper's\nvocabulary", OURS: "our default\nvocabulary"}


@dataclass(frozen=True)
class Told:
    """The episodes of one agent with what was said of them, at one cut.

    Attributes:
        shown: ``E`` episodes.
        cut: where they end.
        listened: what was said and foretold.
        vocabularies: that it was said in.
        task: with ``scene_path``.
        horizon_steps: from the last frame that observers see to the end.
    """

    shown: Sequence[Shown]
    cut: str
    listened: Listened
    vocabularies: dict[str, ClusterMapping]
    task: Task
    horizon_steps: int

    def last_seen(self, row: int) -> int:
        """The step at which the observers foretell."""
        return self.shown[row].ends[self.cut] - self.horizon_steps

    def path(self, row: int, first: int, last: int) -> Array:
        """The way ``(n, 2)`` in scene units from one step to another, both included."""
        assert self.task.scene_path is not None
        return self.task.scene_path(self.shown[row].watched.episode.states[first : last + 1])

    def place(self, row: int, expected: float) -> Array:
        """Where ``(2,)`` in the scene it would be at the end, had the explained dimension this value."""
        assert self.task.scene_path is not None
        state = self.shown[row].watched.episode.states[self.shown[row].ends[self.cut]].copy()
        state[self.task.explained[0]] = expected
        return self.task.scene_path(state)

    def errors(self, row: int) -> dict[str, float]:
        """Observer to its error in % of the width."""
        return {name: float(each[row]) for name, each in self.listened.errors(self.task.explained_range[0]).items()}


@rc_context(DARK)
def strip(told: Told, row: int, title: str) -> Figure:
    """One episode: the explanations at the first frames, these frames, and the rest with what was foretold."""
    figure, [[scale, before, after]] = grid(1, 3, 13, 4.3, width_ratios=[1, 1.32, 1.32])
    last, end = told.last_seen(row), told.shown[row].ends[told.cut]
    _scales(scale, told, row)
    for axis, steps in ((before, range(last - SEEN_STEPS + 1, last + 1)), (after, range(last, end + 1))):
        _scene(axis, told, row, steps)
        _frame(axis, told, _highest(told, [row]))
    _guesses(after, told, row)
    scale.set_title(f"What it said in these {SEEN_STEPS} frames")
    before.set_title(f"The first {SEEN_STEPS} frames: all that observers see")
    after.set_title(f"The last {told.horizon_steps} frames, and what was foretold")
    errors = told.errors(row)
    handles, labels = after.get_legend_handles_labels()
    named = [f"{label} ({errors[name]:.1f} % off)" for name, label in zip((*GUESSES, TRUE_FUTURE), labels, strict=True)]
    named[-1] = "where it really came down"
    figure.legend(handles, named, loc="outside lower center", ncols=4)
    figure.suptitle(title)
    return figure


def _scales(axis: Axes, told: Told, row: int) -> None:
    """For each vocabulary its expressions as ticks on one scale, and what was said, frame by frame downwards."""
    for band, name in enumerate((PAPER, OURS)):
        top = band * (SEEN_STEPS + 6)
        said = told.listened.said[name][row]
        marks = told.vocabularies[name].expressions[:, 0]
        axis.vlines(marks, top - 1, top + SEEN_STEPS, color=LINE, linewidth=1.2)
        axis.axhline(top - 1, color=FAINT, linewidth=0.8)
        axis.scatter(
            said, top + np.arange(SEEN_STEPS), color=[hexed(each) for each in colours.of_expressions(said)], s=26
        )
        axis.scatter(said[-1], top + SEEN_STEPS - 1, s=90, facecolor="none", edgecolor=SHADES[name], linewidth=1.6)
        axis.text(
            -1.28,
            top + SEEN_STEPS / 2,
            BAND_NAMES[name],
            rotation=90,
            ha="center",
            va="center",
            color=SHADES[name],
            fontsize=9,
        )
    axis.set(xlim=(-1.12, 1.12), ylim=(2 * SEEN_STEPS + 7, -2.5), yticks=[])
    axis.set_xticks([-1, 0, 1], ["-1 left", "0 straight", "+1 right"])
    axis.set_xlabel("expression, frame by frame downwards (lines: $m^i$;\nring: what the observer goes by)")
    axis.grid(visible=False)
    axis.spines["left"].set_visible(False)


def _scene(axis: Axes, told: Told, row: int, steps: range) -> None:
    """The ground, the way over these steps and the outlines on it."""
    watched = told.shown[row].watched
    _lines(axis, watched.background, 1.5, 1.0)
    path = told.path(row, steps[0], steps[-1])
    axis.plot(*path.T, color=hexed((150, 140, 200)), linewidth=1.3)
    marked = [*steps[:: EVERY if len(steps) <= SEEN_STEPS else 3 * EVERY], steps[-1]]
    for step in dict.fromkeys(marked):
        faded = 0.3 + 0.7 * (step - steps[0]) / max(1, len(steps) - 1)
        _lines(axis, watched.figures[step], 1.3, faded)


def _lines(axis: Axes, shapes: Sequence[Shape], width: float, alpha: float) -> None:
    lines = [np.concatenate([shape.points, shape.points[:1]]) if shape.closed else shape.points for shape in shapes]
    axis.add_collection(
        LineCollection(lines, colors=[hexed(shape.colour) for shape in shapes], linewidths=width, alpha=alpha)
    )


def _frame(axis: Axes, told: Told, highest: float) -> None:
    """The whole width and only the heights at which something happens, so that panels can be compared."""
    axis.set(xlim=(0, told.task.scene_size[0]), ylim=(0, highest), aspect="equal", xticks=[], yticks=[])
    axis.grid(visible=False)
    for spine in axis.spines.values():
        spine.set(visible=True, color=LINE)


def _highest(told: Told, rows: Sequence[int]) -> float:
    """The upper edge of a scene with everything in it that observers see in these episodes."""
    tops = [told.path(row, told.last_seen(row) - SEEN_STEPS + 1, told.last_seen(row))[:, 1].max() for row in rows]
    return min(float(max(tops)) + ROOM_ABOVE * told.task.scene_size[1], told.task.scene_size[1])


def _guesses(axis: Axes, told: Told, row: int, size: float = 8) -> None:
    """Where each observer expects it to come down, and where it did; each in a line of its own below the ground."""
    step = LINE_APART * told.task.scene_size[1]
    for number, name in enumerate((*GUESSES, TRUE_FUTURE)):
        x, y = told.place(row, float(told.listened.expected[name][0, row]))
        x = min(max(x, 0.0), told.task.scene_size[0])  # what lies outside is shown at the edge
        below = y - (1.6 + number) * step
        axis.plot([x, x], [below, y], color=SHADES[name], linewidth=1, linestyle=":")
        bigger = 1.5 if name == TRUE_FUTURE else 1.0
        axis.plot([x], [below], MARKERS[name], color=SHADES[name], markersize=size * bigger, label=LABELS[name])


@rc_context(DARK)
def gallery(told: Told, title: str) -> Figure:
    """All episodes: the frames that observers see in the colours of what was said, then the rest and the guesses."""
    count = len(told.shown)
    lines = -(-count // COLUMNS)
    highest = _highest(told, range(count))
    figure, rows = grid(lines, COLUMNS, 13, (3.3 * highest / told.task.scene_size[0] + 0.35) * lines + 1.3)
    axes = [axis for row in rows for axis in row]
    for row, axis in enumerate(axes[:count]):
        last, end = told.last_seen(row), told.shown[row].ends[told.cut]
        _lines(axis, told.shown[row].watched.background, 1, 1)
        axis.plot(*told.path(row, last, end).T, color=hexed(colours.PALE), linewidth=1)
        said = told.listened.said[OURS][row]
        seen = told.path(row, last - SEEN_STEPS + 1, last)
        axis.scatter(
            seen[:, 0], seen[:, 1], color=[hexed(each) for each in colours.of_expressions(said)], s=18, zorder=3
        )
        for step in (last, end):
            _lines(axis, told.shown[row].watched.figures[step], 0.9, 0.9)
        _guesses(axis, told, row, 5)
        _frame(axis, told, highest)
        errors = told.errors(row)
        axis.set_title(
            f"{row + 1}:  none {errors[NOTHING]:.1f}, paper's {errors[PAPER]:.1f}, ours {errors[OURS]:.1f} % off",
            fontsize=9,
        )
    for axis in axes[count:]:
        axis.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    figure.suptitle(
        f"{title}\ndots: the frames that observers see, blue where it says left, grey straight, orange right",
        color=INK,
    )
    return figure
