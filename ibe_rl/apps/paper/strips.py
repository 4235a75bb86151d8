"""Episodes of the prediction task as the paper shows them: what was said, what was seen, and what came."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ibe_rl.apps.paper.names import (
    DEFAULT,
    NO_WORDS,
    OBSERVER_COLOURS,
    OBSERVER_LABELS,
    OBSERVER_MARKERS,
    PAPERS,
    TRUE_END,
    VOCABULARY_NAMES,
)
from ibe_rl.apps.paper.prediction_task import ObservedEpisodes
from ibe_rl.apps.plot_style import DARK, FAINT, INK, LINE, draw_shapes, expression_colours, grid, hexed, legend_of
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.view import palette as colours

GUESSES = (NO_WORDS, PAPERS, DEFAULT)
OUTLINE_STEPS = 4
"""Steps from one outline to the next."""
_COLUMNS = 4
ROOM_ABOVE, LINE_APART = 0.12, 0.05
"""Of the scene's height: above the highest point of a path, and from one line of markers to the next."""


@rc_context(DARK)
def episode_strip(observed: ObservedEpisodes, row: int, title: str) -> Figure:
    """One episode: the explanations at the first frames, these frames, and the rest with what was foretold."""
    figure, [[scale, before, after]] = grid(1, 3, 13, 4.3, width_ratios=[1, 1.32, 1.32])
    last, end = observed.last_seen(row), observed.shown[row].ends[observed.cut]
    _scales(scale, observed, row)
    for axis, steps in ((before, range(last - SEEN_STEPS + 1, last + 1)), (after, range(last, end + 1))):
        _scene(axis, observed, row, steps)
        _frame(axis, observed, _highest(observed, [row]))
    _guesses(after, observed, row)
    scale.set_title(f"What it said in these {SEEN_STEPS} frames")
    before.set_title(f"The first {SEEN_STEPS} frames: all that observers see")
    after.set_title(f"The last {observed.horizon_steps} frames, and what was predicted")
    errors = observed.errors()
    handles, labels = after.get_legend_handles_labels()
    named = [
        f"{label} ({errors[name][row]:.1f} % off)" for name, label in zip((*GUESSES, TRUE_END), labels, strict=True)
    ]
    named[-1] = "where it came down"
    figure.legend(handles, named, loc="outside lower center", ncols=4)
    figure.suptitle(title)
    return figure


def _scales(axis: Axes, observed: ObservedEpisodes, row: int) -> None:
    """For each vocabulary its expressions as ticks on one scale, and what was said, frame by frame downwards."""
    for band, name in enumerate((PAPERS, DEFAULT)):
        top = band * (SEEN_STEPS + 6)
        said = observed.said[name][row]
        marks = observed.vocabularies[name].expressions[:, 0]
        axis.vlines(marks, top - 1, top + SEEN_STEPS, color=LINE, linewidth=1.2)
        axis.axhline(top - 1, color=FAINT, linewidth=0.8)
        colour = OBSERVER_COLOURS[name]
        axis.scatter(said, top + np.arange(SEEN_STEPS), color=expression_colours(said), s=26)
        axis.scatter(said[-1], top + SEEN_STEPS - 1, s=90, facecolor="none", edgecolor=colour, linewidth=1.6)
        title, middle = VOCABULARY_NAMES[name].replace(" vocabulary", "\nvocabulary"), top + SEEN_STEPS / 2
        axis.text(-1.28, middle, title, rotation=90, ha="center", va="center", color=colour, fontsize=9)
    axis.set(xlim=(-1.12, 1.12), ylim=(2 * SEEN_STEPS + 7, -2.5), yticks=[])
    axis.set_xticks([-1, 0, 1], ["-1 left", "0 straight", "+1 right"])
    axis.set_xlabel("expression, frame by frame downwards (lines: mⁱ;\nring: what the observer reads)")
    axis.grid(visible=False)
    axis.spines["left"].set_visible(False)


def _scene(axis: Axes, observed: ObservedEpisodes, row: int, steps: range) -> None:
    """The ground, the way over these steps and the outlines on it."""
    watched = observed.shown[row].watched
    draw_shapes(axis, watched.background, 1.5, 1.0)
    path = observed.path(row, steps[0], steps[-1])
    axis.plot(*path.T, color=hexed(colours.TRAIL), linewidth=1.3)
    marked = [*steps[:: OUTLINE_STEPS if len(steps) <= SEEN_STEPS else 3 * OUTLINE_STEPS], steps[-1]]
    for step in dict.fromkeys(marked):
        faded = 0.3 + 0.7 * (step - steps[0]) / max(1, len(steps) - 1)
        draw_shapes(axis, watched.figures[step], 1.3, faded)


def _frame(axis: Axes, observed: ObservedEpisodes, highest: float) -> None:
    """The whole width and only the heights at which something happens, so that panels can be compared."""
    axis.set(xlim=(0, observed.task.scene_size[0]), ylim=(0, highest), aspect="equal", xticks=[], yticks=[])
    axis.grid(visible=False)
    for spine in axis.spines.values():
        spine.set(visible=True, color=LINE)


def _highest(observed: ObservedEpisodes, rows: Sequence[int]) -> float:
    """The upper edge of a scene with everything in it that observers see in these episodes."""
    tops = [
        observed.path(row, observed.last_seen(row) - SEEN_STEPS + 1, observed.last_seen(row))[:, 1].max()
        for row in rows
    ]
    return min(float(max(tops)) + ROOM_ABOVE * observed.task.scene_size[1], observed.task.scene_size[1])


def _guesses(axis: Axes, observed: ObservedEpisodes, row: int, size: float = 8) -> None:
    """Where each observer expects it to come down, and where it did; each in a line of its own below the ground."""
    step = LINE_APART * observed.task.scene_size[1]
    for number, name in enumerate((*GUESSES, TRUE_END)):
        x, y = observed.place(row, float(observed.expected[name][0, row]))
        x = min(max(x, 0.0), observed.task.scene_size[0])  # what lies outside is shown at the edge
        below = y - (1.6 + number) * step
        axis.plot([x, x], [below, y], color=OBSERVER_COLOURS[name], linewidth=1, linestyle=":")
        bigger = 1.5 if name == TRUE_END else 1.0
        axis.plot(
            [x],
            [below],
            OBSERVER_MARKERS[name],
            color=OBSERVER_COLOURS[name],
            markersize=size * bigger,
            label=OBSERVER_LABELS[name],
        )


@rc_context(DARK)
def gallery(observed: ObservedEpisodes, title: str) -> Figure:
    """All episodes: the frames that observers see in the colours of what was said, then the rest and the guesses."""
    count, errors = len(observed.shown), observed.errors()
    lines = -(-count // _COLUMNS)
    highest = _highest(observed, range(count))
    figure, rows = grid(lines, _COLUMNS, 13, (3.3 * highest / observed.task.scene_size[0] + 0.35) * lines + 1.3)
    axes = [axis for row in rows for axis in row]
    for row, axis in enumerate(axes[:count]):
        last, end = observed.last_seen(row), observed.shown[row].ends[observed.cut]
        draw_shapes(axis, observed.shown[row].watched.background, 1, 1)
        axis.plot(*observed.path(row, last, end).T, color=hexed(colours.PALE), linewidth=1)
        said = observed.said[DEFAULT][row]
        seen = observed.path(row, last - SEEN_STEPS + 1, last)
        axis.scatter(seen[:, 0], seen[:, 1], color=expression_colours(said), s=18, zorder=3)
        for step in (last, end):
            draw_shapes(axis, observed.shown[row].watched.figures[step], 0.9, 0.9)
        _guesses(axis, observed, row, 5)
        _frame(axis, observed, highest)
        none, papers, ours = (errors[name][row] for name in GUESSES)
        axis.set_title(f"{row + 1}:  none {none:.1f}, paper's {papers:.1f}, ours {ours:.1f} % off", fontsize=9)
    for axis in axes[count:]:
        axis.set_visible(False)
    legend_of(axes[:1], figure, 4)
    figure.suptitle(
        f"{title}\ndots: the frames that observers see, blue where it says left, grey straight, orange right",
        color=INK,
    )
    return figure
