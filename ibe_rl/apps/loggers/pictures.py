"""The pictures of a refresh: its clusters with their phrases, and the recorded episode with its explanations."""

from __future__ import annotations

from io import BytesIO
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ibe_rl.apps.plot_style import DARK, FAINT, INK, draw_shapes, expression_colours, grid, hexed
from ibe_rl.ibe.mapping import ClusterMapping, movements_said
from ibe_rl.task import Task
from ibe_rl.types import Array
from ibe_rl.view import palette as colours
from ibe_rl.view import picture
from ibe_rl.view.blueprint import numbers_of
from ibe_rl.view.sentences import cluster_phrases
from ibe_rl.vocabulary.listener import Refreshed
from ibe_rl.vocabulary.refresh import Refresh

_DPI = 100
SILENT = hexed(colours.SILENT_GREY)
_DRAWN: WeakKeyDictionary[Refreshed, dict[str, bytes]] = WeakKeyDictionary()


def pictures_of(event: Refreshed, task: Task) -> dict[str, bytes]:
    """The contents of PNG files by name, drawn once for all loggers.

    Not to be called in a thread: matplotlib's style is global.
    """
    if event not in _DRAWN:
        _DRAWN[event] = {
            "clusters": _png(draw_clusters(event.refresh, task)),
            "episode": _png(draw_episode(event, task)),
        }
    return _DRAWN[event]


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return stream.getvalue()


@rc_context(DARK)
def draw_clusters(refresh: Refresh, task: Task) -> Figure:
    """Left: changes of the best episodes by what they express. Right: the expressions with their phrases."""
    mapping, numbers = refresh.standing, len(numbers_of(task))
    figure, [[scatter, *bars]] = grid(1, 1 + numbers, 6 + 3 * numbers, 4.2, width_ratios=[1.4] + [1] * numbers)
    _scatter(scatter, refresh, task)
    for number, axis in enumerate(bars):
        values = mapping.expressions[:, number]
        axis.barh(np.arange(len(values)), values, color=expression_colours(values))
        axis.axvline(0, color=FAINT, linewidth=0.8)
        axis.set(xlim=(-1.05, 1.05), xlabel="expression", yticks=[], title=task.expression_names[number])
    bars[0].set_yticks(np.arange(len(mapping.ids)), _labels(mapping, task))
    figure.suptitle(f"Vocabulary at {refresh.frame:,} frames")
    return figure


def _labels(mapping: ClusterMapping, task: Task) -> list[str]:
    return [f"{phrase}  #{cluster}" for cluster, phrase in cluster_phrases(mapping, task.phrases).items()]


def _scatter(axis: Axes, refresh: Refresh, task: Task) -> None:
    """Windows coloured by what they express, and the centres of the clusters by their ids."""
    mapping, delta = refresh.standing, picture.sample(refresh.top)
    first, *others = task.explained
    second = others[0] if others else picture.second_dimension(mapping, first, delta)
    across = picture.axis(task, first, delta, symmetric=True)
    up = picture.axis(task, second, delta, symmetric=False)
    axis.scatter(delta[:, first], delta[:, second], color=expression_colours(mapping.express(delta)), s=7)
    style: dict[str, Any] = {"color": INK, "ha": "center", "va": "center", "fontsize": 9, "fontweight": "bold"}
    for row, (cluster, centre) in enumerate(zip(mapping.ids, mapping.centre_changes(), strict=True)):
        place = np.clip(centre[first], across.low, across.high), np.clip(centre[second], up.low, up.high)
        apart = (0, 12 * (row % 3 - 1))  # points; neighbours would cover each other
        axis.annotate(f"#{cluster}", place, xytext=apart, textcoords="offset points", **style)
    axis.set(xlim=(across.low, across.high), ylim=(up.low, up.high), xlabel=across.title, ylabel=up.title)
    axis.set_title(f"change in {refresh.top.horizon_steps} steps of the best episodes")


@rc_context(DARK)
def draw_episode(event: Refreshed, task: Task) -> Figure:
    """The path with the predicted ones, the instruction with the explanation, and what was said, step by step."""
    scene, numbers = task.scene_path is not None, len(numbers_of(task))
    heights = [3.2] * scene + [1.0] * numbers + [0.25]
    figure, rows = grid(len(heights), 1, 9, sum(heights) + 1.4, height_ratios=heights)
    axes = [row[0] for row in rows]
    if scene:
        _scene(axes[0], event, task)
    for number, axis in enumerate(axes[scene:-1]):
        _signal(axis, event, task, number)
    _said(axes[-1], event, figure)
    outcome = "success" if event.rollout.episode.success else "no success"
    figure.suptitle(f"Episode recorded at {event.frames:,} frames: {outcome}")
    return figure


def _scene(axis: Axes, event: Refreshed, task: Task) -> None:
    """The path in the colours of what was said, and the predicted paths."""
    assert task.scene_path is not None
    draw_shapes(axis, event.rollout.background, width=1.5, alpha=1.0)
    made = np.unique(picture.made_at(event.said))
    predicted = [task.scene_path(event.said[step].trusted_path) for step in made]
    axis.add_collection(LineCollection(predicted, colors=FAINT, linewidths=0.6, alpha=0.5))
    path = task.scene_path(event.rollout.episode.states[:-1])
    axis.scatter(path[:, 0], path[:, 1], color=_shades(event), s=8, zorder=3)
    width, height = task.scene_size
    top = max(height, float(path[:, 1].max()))
    axis.set(xlim=(0, width), ylim=(0, top), aspect="equal", xticks=[], yticks=[])
    axis.grid(visible=False)
    axis.set_title("path in the colours of what was said; thin: predicted paths")


def _signal(axis: Axes, event: Refreshed, task: Task, number: int) -> None:
    """One number of the instruction and of the explanation; gaps where there is none."""
    episode = event.rollout.episode
    instruction = np.where(np.asarray(episode.given, bool), episode.instructions[:, number], np.nan)
    explained = np.where([one.meant for one in event.said], movements_said(event.said)[:, number], np.nan)
    axis.step(np.arange(len(instruction)), instruction, where="post", color=hexed(colours.INSTRUCTED))
    axis.step(np.arange(len(explained)), explained, where="post", color=hexed(colours.EXPLANATION))
    axis.set(xlim=(0, len(explained)), ylim=(-1.15, 1.15), ylabel=task.expression_names[number])
    named = {"instruction": colours.INSTRUCTED, "explanation": colours.EXPLANATION}
    handles = [Patch(color=hexed(colour), label=label) for label, colour in named.items()]
    axis.legend(handles=handles, loc="upper right", ncols=2)


def _said(axis: Axes, event: Refreshed, figure: Figure) -> None:
    """What was said as a lane of colours, named below."""
    shades, words = _shades(event), [one.said for one in event.said]
    starts = picture.changes(words)
    for start, end in zip(starts, [*starts[1:], len(words)], strict=True):
        axis.axvspan(start, end, color=shades[start], linewidth=0)
    axis.set(xlim=(0, len(words)), yticks=[], xlabel="step")
    named = {words[i]: Patch(color=shades[i], label=words[i]) for i in reversed(starts)}
    figure.legend(handles=list(reversed(named.values())), loc="outside lower center", ncols=3)


def _shades(event: Refreshed) -> list[str]:
    """Colours of what was said at each step, grey where it does not know."""
    expressions: Array = np.array([one.expression for one in event.said])
    shades = zip(expression_colours(expressions), event.said, strict=True)
    return [shade if one.known else SILENT for shade, one in shades]
