"""The task of gymnasium's BipedalWalker (Box2D): to walk upright."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.envs.box2d import bipedal_walker as course

from ibe_rl.types import Array

UPRIGHT_HULL_RAD = 0.05
"""Within this angle the hull counts as upright."""
HULL_ANGLE, HULL_TURNING, HULL_PLACE = 0, 1, 4
COURSE_END_M = (course.TERRAIN_LENGTH - course.TERRAIN_GRASS) * course.TERRAIN_STEP
STEPS_PER_S = course.FPS


def hull_state(env: Any, observation: Array) -> Array:
    """What the words are about.

    Args:
        env: the walker.
        observation: not read.

    Returns:
        ``(5,)`` of the hull: angle in rad (positive leans back), angular velocity in rad/s, forward and vertical speed
        in m/s, and its place in m.
    """
    del observation
    hull = env.hull
    velocity = hull.linearVelocity
    return np.array([hull.angle, hull.angularVelocity, velocity.x, velocity.y, hull.position.x])


def stand_upright(states: Array) -> Array:
    """How to lean: states ``(..., 5)`` to ``(..., 1)`` float32, -1 forward, +1 back, 0 upright."""
    lean = upright_from_hull(states)
    return np.where(np.abs(lean) > UPRIGHT_HULL_RAD, np.sign(lean), 0.0).astype(np.float32)


def upright_from_hull(states: Array) -> Array:
    """States ``(..., 5)`` to the angle ``(..., 1)`` from the hull to upright, in rad."""
    return -states[..., HULL_ANGLE, None]


def hull_motion(states: Array) -> Array:
    """States ``(..., 5)`` to the change ``(..., 1)`` of the hull's angle in one step at its angular velocity."""
    return states[..., HULL_TURNING, None] / STEPS_PER_S


def walked_to_the_end(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the episode ended at the end of the course, and not by a fall or at its beginning."""
    del truncated
    return terminated and bool(state[HULL_PLACE] > COURSE_END_M)
