"""The lander with instructions of two numbers: which way to fall, and whether to fall faster or slower.

The wanted sinking speed falls with the height; rest on the ground is within its tolerance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ibe_rl.envs.lander_task import (
    LANDER_MIRROR,
    LANDER_TASK,
    VY,
    X,
    Y,
    lander_goal_offset,
    lander_instruction,
    lander_motion,
)
from ibe_rl.task import DEGREES, Phrases
from ibe_rl.types import Array

SPEED_AT_GROUND, SPEED_BY_HEIGHT = 0.08, 0.6
"""Wanted sinking speed in units of vy (7.5 m/s): on the ground, and added per half height."""
SPEED_TOLERANCE = 0.1
"""Largest deviation, in units of vy, that counts as wanted."""


def too_slow(states: Array) -> Array:
    """States ``(..., 9)`` to wanted minus actual sinking speed ``(...)``, in units of vy."""
    return states[..., VY] + SPEED_AT_GROUND + SPEED_BY_HEIGHT * np.maximum(states[..., Y], 0)


def instruct_both(states: Array) -> Array:
    """Which way to fall, and how fast.

    Args:
        states: ``(..., 9)``.

    Returns:
        ``(..., 2)`` float32: the rule of ``lander_task``; and -1 sink faster, +1 sink slower, 0 keep the speed.
    """
    slow = too_slow(states)
    speed = np.where(slow > SPEED_TOLERANCE, -1.0, np.where(slow < -SPEED_TOLERANCE, 1.0, 0.0))
    return np.concatenate([lander_instruction(states), speed.astype(np.float32)[..., None]], axis=-1)


def motion_of_both(states: Array) -> Array:
    """States ``(..., 9)`` to the changes ``(..., 2)`` of x and vy in one step at the current velocity."""
    return np.concatenate([lander_motion(states), np.zeros_like(states[..., [VY]])], axis=-1)


def offset_of_both(states: Array) -> Array:
    """States ``(..., 9)`` to ``(..., 2)``: the pad's middle minus x, and the wanted minus the actual vy."""
    return np.concatenate([lander_goal_offset(states), -too_slow(states)[..., None]], axis=-1)


LANDER_SPEED_TASK = replace(
    LANDER_TASK,
    mirror=replace(LANDER_MIRROR, instruction=(-1.0, 1.0)),
    name="Lunar Lander, way and speed",
    rule=instruct_both,
    phrases=(
        *LANDER_TASK.phrases,
        Phrases(
            zero="as fast as now",
            negative="{degree}faster",
            positive="{degree}slower",
            degrees=DEGREES,
        ),
    ),
    explained=(X, VY),
    explained_band=(0.05, 0.1),
    explained_range=(2.0, 1.0),
    motion=motion_of_both,
    goal_offset=offset_of_both,
)
