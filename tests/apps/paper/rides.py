"""Rides of the lift of tests/by_hand.py, made by hand; here its whole state is how high it is, in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from by_hand import TASK as LIFT

from ibe_rl.task import Task
from ibe_rl.types import Episode

TASK: Task = replace(
    LIFT,
    state_names=("height",),
    state_units=("m",),
    rule=lambda states: np.sign(states),
    explained_range=(20.0,),
    motion=lambda states: states / 10,
    first_contact=lambda states: int(np.argmin(states[:, 0])),
)
"""It counts as moved beyond half a metre and is called still below 0.3; moves a tenth of its height a step; the shaft
is 20 m high, and it touches the ground at its lowest."""


def ride(
    heights: Sequence[float],
    instruction: float | Sequence[float] = 0.0,
    reward: float = 0.0,
    context: str = "lower",
    given: bool | Sequence[bool] = True,
    terminated: bool = True,
) -> Episode:
    """An episode through these heights; what was told, and whether, at each step or at all of them."""
    steps = len(heights) - 1
    return Episode(
        states=np.array(heights, float)[:, None],
        actions=np.zeros(steps, int),
        rewards=np.full(steps, reward / steps),
        instructions=np.broadcast_to(instruction, steps).astype(float)[:, None],
        given=np.broadcast_to(given, steps),
        terminated=terminated,
        success=terminated,
        context=context,
    )
