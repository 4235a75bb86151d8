"""One refresh in charts: its clusters, their expressions, and what they were learnt from."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import rerun as rr

from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.word_meaning import top_words
from ibe_rl.metrics.histogram import bin_edges, densities
from ibe_rl.task import Task
from ibe_rl.types import Array
from ibe_rl.view import palette as colours
from ibe_rl.view import picture
from ibe_rl.view.marks import labelled, round_steps
from ibe_rl.vocabulary.refresh import Refresh

_HEIGHT = 0.45
"""Of the scatter in units of its half width, for a panel that is broader than high."""
BARS = 0.36
"""Height of a histogram in units of its half width."""
_LETTER_WIDTH = 0.052
"""In the same units, at 1440 x 900."""


def log_vocabulary(recording: rr.RecordingStream, task: Task, refresh: Refresh, shown: Collection[int] = ()) -> None:
    """Draw a vocabulary that was just learnt; clusters that are ``shown`` and no more in it go."""
    log_clusters(recording, task, refresh)
    for number in range(task.instruction_size):
        for name in sorted(set(shown) - set(refresh.mapping.ids.tolist())):
            recording.log(f"{picture.entity(task, 'development', number)}/{name}", rr.Scalars(np.nan))  # the line ends
        log_expressions(recording, task, refresh, number)
    for number in range(len(task.explained)):
        log_changes(recording, task, refresh, number)


def log_clusters(recording: rr.RecordingStream, task: Task, refresh: Refresh) -> None:
    """Draw windows of the best episodes, coloured by what they express, and the clusters.

    With several numbers the axes are the dimensions that the first two speak of.
    """
    mapping, delta = refresh.mapping, picture.sample(refresh.top)
    first, *others = task.explained
    across = picture.axis(task, first, delta, symmetric=True)
    second = others[0] if others else picture.second_dimension(mapping, first, delta)
    up = picture.axis(task, second, delta, symmetric=False)
    log_axes(recording, across, up)
    shades = colours.of_expressions(mapping.express(delta))
    points, size = scatter(across, up, delta), rr.Radius.ui_points(1.3)
    recording.log("vocabulary/windows", rr.Points2D(points, colors=shades, radii=size))
    labels = [f"#{name} {value:+.2f}" for name, value in zip(mapping.ids, mapping.expressions[:, 0], strict=True)]
    if task.words is not None:
        labels = [f"#{name} {task.words.name_at(slot)}" for name, slot in zip(mapping.ids, _tops(mapping), strict=True)]
    elif others:  # no room for all of their numbers
        labels = [f"#{name}" for name in mapping.ids]
    log_centres(recording, scatter(across, up, mapping.centre_changes()), colours.of_clusters(mapping.ids), labels)


def _tops(mapping: ClusterMapping) -> list[int]:
    tops: list[int] = top_words(mapping.expressions).tolist()
    return tops


def scatter(across: picture.Axis, up: picture.Axis, delta: Array) -> Array:
    """Changes ``(W, S)`` to points ``(W, 2)`` of the scatter, y down."""
    x, y = (axis.place(delta[:, axis.dimension]) for axis in (across, up))
    return np.stack([x, -_HEIGHT * y], axis=-1).astype(np.float32)


def log_axes(recording: rr.RecordingStream, across: picture.Axis, up: picture.Axis) -> None:
    """Draw the axes of the scatter, and its marks and titles along the bottom and the left edge."""
    zero = -_HEIGHT * float(up.place([0.0])[0])
    lines = [[(-1, zero), (1, zero)], [(0, -_HEIGHT), (0, _HEIGHT)], [(-1, -_HEIGHT), (-1, _HEIGHT), (1, _HEIGHT)]]
    axes = rr.LineStrips2D(lines, colors=[colours.AXIS], radii=rr.Radius.ui_points(0.5))
    recording.log("vocabulary/axes", axes)
    marks = [
        ((x, _HEIGHT), f"{tick:+.2g}") for tick, x in zip(across.ticks(), across.place(across.ticks()), strict=True)
    ]
    marks += [((-1.0, -_HEIGHT * y), f"{tick:+.2g}") for tick, y in zip(up.ticks(), up.place(up.ticks()), strict=True)]
    for title, side in ((f"→ {across.title}", 1), (f"↑ {up.title}", -1)):  # side by side, however long
        marks.append(((side * (_LETTER_WIDTH * len(title) / 2 + 0.06), _HEIGHT + 0.15), title))
    places, labels = zip(*marks, strict=True)
    dots = rr.Points2D(places, labels=labels, colors=[colours.AXIS], radii=rr.Radius.ui_points(1.5), show_labels=True)
    recording.log("vocabulary/marks", dots)


def log_centres(recording: rr.RecordingStream, points: Array, shades: Array, labels: Sequence[str]) -> None:
    """Draw the centres ``(k, 2)`` of the clusters, their names in two rows above, with lines between."""
    size = rr.Radius.ui_points(6)
    recording.log("vocabulary/centres", rr.Points2D(points, colors=shades, radii=size, draw_order=60.0))
    places = picture.label_rows(points, -_HEIGHT - 0.16)
    leaders = rr.LineStrips2D(np.stack([places, points], axis=1), colors=shades, radii=rr.Radius.ui_points(0.4))
    recording.log("vocabulary/leaders", leaders)
    names = rr.Points2D(places, colors=shades, labels=labels, radii=rr.Radius.ui_points(2), show_labels=True)
    recording.log("vocabulary/names", names)


def log_expressions(recording: rr.RecordingStream, task: Task, refresh: Refresh, number: int) -> None:
    """Add one number of each cluster's expression to the curve of the cluster, by its lasting id."""
    for name, value in expressions(refresh, number).items():
        recording.log(f"{picture.entity(task, 'development', number)}/{name}", rr.Scalars(value))


def expressions(refresh: Refresh, number: int) -> dict[int, float]:
    """One number of the expression of each cluster, by the lasting id."""
    mapping = refresh.mapping
    return dict(zip(mapping.ids.tolist(), mapping.expressions[:, number].tolist(), strict=True))


def log_changes(recording: rr.RecordingStream, task: Task, refresh: Refresh, number: int) -> None:
    """Draw how an explained dimension changed in the best and in other episodes (the paper's histograms)."""
    best, others = (windows.delta[:, task.explained[number]] for windows in (refresh.top, refresh.others))
    edges, entity = bin_edges(np.concatenate([best, others])), picture.entity(task, "change", number)
    drawn = picture.cut(densities([best, others], edges))
    highest = float(np.max(drawn)) or 1.0
    for name, density, colour in zip(("best", "others"), drawn, (colours.GREEN, colours.MUTED), strict=True):
        line = rr.LineStrips2D([outline_of_bars(density / highest)], colors=[colour], radii=rr.Radius.ui_points(1))
        recording.log(f"{entity}/{name}", line)
    lines: list[list[tuple[float, float]]] = [[(-1, 0), (1, 0)], [(0, 0), (0, -BARS)]]
    axes = rr.LineStrips2D(lines, colors=[colours.AXIS], radii=rr.Radius.ui_points(0.5))
    recording.log(f"{entity}/axes", axes)
    ticks = round_steps(-edges[-1], edges[-1], 4)
    recording.log(f"{entity}/marks", labelled([((x / edges[-1], 0.0), f"{x:g}", colours.AXIS) for x in ticks]))


def outline_of_bars(heights: Array) -> Array:
    """The outline ``(2 B + 2, 2)`` of bars of these heights ``(B,)`` in [0, 1] side by side, y down."""
    x = np.repeat(np.linspace(-1, 1, len(heights) + 1), 2)
    return np.stack([x, -BARS * np.concatenate([[0], np.repeat(heights, 2), [0]])], axis=1)
