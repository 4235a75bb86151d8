"""What people see of an episode, as shapes in JSON: the environment's own drawing, or lines where it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.task import RecordedRollout, Shape, Task
from ibe_rl.types import Array, Episode
from ibe_rl.view import palette as colours

FORMAT = 1
"""Of the files of episodes."""
LINES_SIZE = (16.0, 10.0)
"""Width and height of a scene of lines."""
_WITHIN = 0.01, 0.99
"""Quantiles of the states that a scene of lines shows; what lies outside is drawn at its edge."""
_ROOM, _MARKER, _DIGITS = 0.05, 0.3, 4


@dataclass(frozen=True)
class Scene:
    """Where things are drawn.

    Attributes:
        task: of the environment.
        size: width and height in scene units.
        low: ``(2,)`` of a scene of lines: the values at its lower left corner; None: the environment's own scene.
        high: ``(2,)`` the values at its upper right corner.
    """

    task: Task
    size: tuple[float, float]
    low: Array | None = None
    high: Array | None = None

    def points(self, states: Array, since: int = 0) -> Array:
        """Where consecutive states ``(N, S)`` are, ``(N, 2)``, y up.

        Args:
            states: consecutive ones.
            since: steps of the first of them since the first frame, where time is drawn.
        """
        if self.low is None or self.high is None:
            assert self.task.scene_path is not None
            return self.task.scene_path(states)
        first, *second = (states[:, dimension].astype(float) for dimension in self.task.explained[:2])
        along = second[0] if second else since + np.arange(len(states), dtype=float)
        share = (np.stack([first, along], axis=-1) - self.low) / (self.high - self.low)
        return np.clip(share, 0.0, 1.0) * self.size

    def share(self, states: Array) -> Array:
        """Where states ``(N, S)`` are, as a share ``(N,)`` of the width."""
        return np.clip(self.points(states)[:, 0] / self.size[0], 0.0, 1.0)

    def background(self, watched: RecordedRollout) -> list[dict[str, Any]]:
        """What does not move."""
        if self.low is None:
            return [as_json(shape) for shape in watched.background]
        width, height = self.size
        edge = np.array([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)])
        return [as_json(Shape(edge, colours.MUTED))]

    def frame(self, watched: RecordedRollout, step: int, first: int) -> list[dict[str, Any]]:
        """What moves, at a step; ``first`` is that of the first frame shown."""
        if self.low is None and watched.figures[step]:
            return [as_json(shape) for shape in watched.figures[step]]
        way = self.points(watched.episode.states[first : step + 1])
        corners = way[-1] + np.array([(0, -_MARKER), (_MARKER, 0), (0, _MARKER), (-_MARKER, 0)])
        return [as_json(Shape(way, colours.TRAIL)), as_json(Shape(corners, colours.WHITE, closed=True))]


def as_json(shape: Shape) -> dict[str, Any]:
    """A shape for the page."""
    points = np.round(np.asarray(shape.points, float), _DIGITS).tolist()
    return {"points": points, "colour": [int(part) for part in shape.colour], "closed": shape.closed}


def about_episode(seed: int, episode: Episode) -> dict[str, Any]:
    """Which episode it is."""
    return {"seed": seed, "context": episode.context, "success": bool(episode.success)}


def scene_of(task: Task, flown: Sequence[Episode], seen_steps: int, goal_may_show: bool = False) -> Scene:
    """The scene of an environment.

    Its own drawing would give the answer away where it shows a goal that the environment cannot hide. Then, and where
    it has none, the first two explained dimensions are drawn as lines; a single one over time.

    Args:
        task: of the environment.
        flown: episodes that tell which values occur.
        seen_steps: how long time goes, where it is drawn.
        goal_may_show: the goal does not tell the answer.
    """
    tells = task.goal_offset is not None and not task.hidden_goal and not goal_may_show
    if task.scene_path is not None and not tells:
        return Scene(task, (float(task.scene_size[0]), float(task.scene_size[1])))
    states = np.concatenate([episode.states for episode in flown])[:, list(task.explained[:2])].astype(float)
    low, high = np.quantile(states, _WITHIN, axis=0)
    wide = np.maximum(high - low, 2 * np.asarray(task.explained_band[: states.shape[1]]))
    middle = (low + high) / 2
    low, high = middle - (0.5 + _ROOM) * wide, middle + (0.5 + _ROOM) * wide
    if len(low) == 1:
        low, high = np.append(low, -_ROOM * seen_steps), np.append(high, (1 + _ROOM) * seen_steps)
    return Scene(task, LINES_SIZE, low, high)
