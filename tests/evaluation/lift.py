"""Moments of a lift, made by hand: heights in metres, over one or two horizons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from by_hand import TASK as LIFT

from ibe_rl.evaluation.moments import Moments
from ibe_rl.ibe import ClusterMapping
from ibe_rl.ibe.space import along
from ibe_rl.task import Task
from ibe_rl.types import Array

TASK: Task = replace(
    LIFT,
    explained_range=(20.0,),
    motion=lambda states: states[..., 1:2] / 10,
    goal_offset=lambda states: 5 - states[..., :1],
    first_contact=lambda states: len(states) - 1,
)
"""Moves a tenth of its speed a step; wants to be at 5 m; the shaft is 20 m high."""


def words(centres: Sequence[float] = (-2, 0, 2), expressions: Sequence[float] = (-1, 0, 1)) -> ClusterMapping:
    """Calls a change of the height what the nearest centre is called."""
    k, said = len(centres), np.reshape(expressions, (-1, 1)).astype(float)
    places, ones = np.reshape(centres, (k, 1)).astype(float), np.ones(k)
    purities = np.linspace(0.5, 1, k)
    return ClusterMapping(along(np.array([[1.0], [0], [0]])), places, said, said, ones, purities, ones, np.arange(k))


def moments(
    realised: Sequence[float],
    predicted: Sequence[Sequence[float]],
    instruction: Sequence[float],
    episode: Sequence[int],
    speed: Sequence[float] | None = None,
    observed: Sequence[bool] | None = None,
) -> Moments:
    """One horizon of 5 steps; heights changed by ``realised``, were ``predicted`` to change in each of the futures."""
    count = len(realised)
    state = np.zeros((count, 3))
    state[:, 1] = 0 if speed is None else speed
    return Moments(
        episode=np.array(episode),
        seed=np.array(episode) + 100,
        step=np.arange(count),
        state=state,
        instruction=np.array(instruction, float)[:, None],
        given=np.ones(count, bool),
        regular=np.ones(count, bool),
        observed=np.zeros(count, bool) if observed is None else np.array(observed),
        realised=heights(np.array(realised, float))[:, None],
        predicted=heights(np.array(predicted, float))[:, :, None],
        trusted=np.ones((count, len(predicted[0]), 1), bool),
        horizons_steps=(5,),
    )


def heights(values: Array) -> Array:
    """Changes of the height as changes of the state."""
    return np.stack([values, np.zeros_like(values), np.zeros_like(values)], axis=-1)
