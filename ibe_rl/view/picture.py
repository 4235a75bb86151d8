"""From episodes, refreshes and explanations to what the view shows of them: coordinates.

Numpy only; the view draws what this module returns. Scene points have y down, as screens do.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.task import Shape, Task
from ibe_rl.types import Array

TRAIL_POINTS = 64
CHANGE = "change"
SCATTER_POINTS = 600
_TINY = 1e-9
_FEW_VALUES = 5


def entity(task: Task, root: str, number: int) -> str:
    """Where what belongs to one number or word of an instruction is logged: of several, in a folder of its own.

    Changes (``CHANGE``) belong to the explained dimensions.
    """
    if root == CHANGE or task.words is None:
        names = task.number_names
        return root if len(names) == 1 else f"{root}/{re.sub(r'[^A-Za-z0-9_]', '_', names[number])}"
    return f"{root}/word_{number}"  # entities have no letters of all scripts


def flipped(points: Array, height: float) -> Array:
    """Points ``(..., 2)`` with y up to y down, in a scene of this height in scene units."""
    return np.stack([points[..., 0], height - points[..., 1]], axis=-1).astype(np.float32)


def strip(shape: Shape, height: float) -> Array:
    """The line along a shape, back to its beginning if the shape is closed: ``(P, 2)``, y down."""
    corners = np.concatenate([shape.points, shape.points[:1]]) if shape.closed else np.asarray(shape.points)
    return flipped(corners, height)


def moving_strips(figures: Sequence[Sequence[Shape]], height: float) -> Array:
    """Outlines of all steps: ``T`` lists of ``F`` shapes to lines ``(T, F, P, 2)``, y down, their ends repeated."""
    lasts = [len(shape.points) - 1 + shape.closed for shape in figures[0]]
    corners = [np.minimum(np.arange(max(lasts) + 1), last) for last in lasts]
    points = [np.stack([shapes[i].points for shapes in figures]) for i in range(len(lasts))]
    lines = [each[:, rows % each.shape[1]] for each, rows in zip(points, corners, strict=True)]
    return flipped(np.stack(lines, axis=1), height)


def trails(path: Array) -> Array:
    """The way behind each step: a path ``(T + 1, 2)`` to lines ``(T + 1, P, 2)`` that end at their step."""
    stride = max(1, -(-len(path) // TRAIL_POINTS))
    marks = np.arange(0, len(path) + stride, stride)
    return path[np.minimum(marks, np.arange(len(path))[:, None])]


def thinned(paths: Array) -> Array:
    """Every second point of paths ``(T, H + 1, 2)``, and the last in any case."""
    rows = np.arange(paths.shape[1])
    return paths[:, (rows % 2 == 0) | (rows == rows[-1])]


def made_at(said: Sequence[object]) -> Array:
    """For each step, the step at which what is said there was said first: ``(T,)``; it is held until the next."""
    new = [i == 0 or said[i] is not said[i - 1] for i in range(len(said))]
    return np.maximum.accumulate(np.where(new, np.arange(len(said)), 0))


def changes(words: Sequence[object]) -> list[int]:
    """Indices at which a sequence differs from the entry before, the first one included."""
    return [i for i, word in enumerate(words) if i == 0 or word != words[i - 1]]


@dataclass(frozen=True)
class Axis:
    """One axis of the scatter: a state dimension and which changes of it lie inside the picture.

    Attributes:
        dimension: index of the state dimension.
        low: change at the lower edge, in observation units, at most 0.
        high: change at the upper edge, at least 0.
        title: name and unit.
    """

    dimension: int
    low: float
    high: float
    title: str

    def place(self, changes: Array | Sequence[float]) -> Array:
        """Changes in observation units to positions in [-1, 1]; what lies farther out is put on the edge."""
        return np.clip((np.asarray(changes, float) - self.low) / (self.high - self.low) * 2 - 1, -1, 1)

    def ticks(self) -> list[float]:
        """A round number on each side of 0 where there is room for one."""
        size = (self.high - self.low) / 2
        power = 10.0 ** np.floor(np.log10(size))
        tick = max(power * factor for factor in (0.2, 0.5, 1, 2, 5) if power * factor <= 0.9 * size)
        return [value for value in (-tick, tick) if self.low <= value <= self.high]


def second_dimension(mapping: ClusterMapping, explained: int, delta: Array) -> int:
    """The dimension that separates the clusters best in standardised units, beside the explained one.

    Dimensions whose changes ``delta`` ``(W, S)`` take few values, such as flags, come last: their points lie on
    top of each other.
    """
    labels, scale = mapping.cluster(delta), np.maximum(delta.std(axis=0), _TINY)
    means = np.array([delta[labels == each].mean(axis=0) for each in np.unique(labels)])
    spread = (means / scale).var(axis=0)
    few = [len(np.unique(column)) <= _FEW_VALUES for column in delta.T]
    spread = np.where(few, spread - spread.max() - 1, spread)
    spread[explained] = -np.inf
    return int(np.argmax(spread))


def label_rows(points: Array, y: float) -> Array:
    """Places ``(k, 2)`` for the labels of points ``(k, 2)``: from left to right as the points, in two rows by turns."""
    order = np.argsort(np.argsort(points[:, 0], kind="stable"))
    x = 1.2 * ((order + 0.5) / len(points) * 2 - 1)  # beyond the axes: the panel is wider than they are
    return np.stack([x, y - 0.16 * (order % 2)], axis=-1)


def axis(task: Task, dimension: int, delta: Array, symmetric: bool) -> Axis:
    """Fit one axis to changes ``(W, S)``: 0 and 99 % of them lie inside; symmetric puts 0 in the middle."""
    name, unit = task.state_names[dimension].replace("_", " "), task.state_units[dimension]
    low, high = np.quantile(np.append(delta[:, dimension], 0.0), [0.005, 0.995]).tolist()
    if symmetric or low == high:
        high = max(abs(low), abs(high)) or 1.0
        low = -high
    return Axis(dimension, min(low, 0.0), max(high, 0.0), f"{name} change ({unit})")


def sample(windows: Windows, count: int = SCATTER_POINTS) -> Array:
    """Changes ``(<= count, S)`` of evenly spaced windows."""
    rows = np.linspace(0, len(windows) - 1, min(count, len(windows))).astype(int)
    return windows.delta[rows]


def cut(densities: Sequence[Array]) -> list[Array]:
    """Cut one peak that would hide the rest, such as that of all who stand still, to twice what is beside it."""
    highest = np.sort(np.max(densities, axis=0))[-2]
    return [np.minimum(density, 2 * highest) if highest > 0 else density for density in densities]
