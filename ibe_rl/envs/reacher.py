"""The task of gymnasium's Reacher, an arm of two links that reaches for a target in the plane (MuJoCo).

An instruction has two numbers: left or right, and down or up. The target is drawn for each episode. Lengths are metres;
the drawing is in decimetres.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ibe_rl.task import Shape
from ibe_rl.types import Array

UPPER, LOWER = 0.1, 0.11
"""Lengths of the links in m."""
STEP_S = 0.02
NEAR = 0.02
"""Within this distance along an axis, in m, the instruction is to stay."""
REACHED = 0.03
SCENE_SCALE, HALF_SCENE = 10.0, 3.0
COS_1, COS_2, SIN_1, SIN_2, SPEED_1, SPEED_2 = 0, 1, 2, 3, 6, 7
TARGET, OFFSET = slice(4, 6), slice(8, 10)


def instruct(states: Array) -> Array:
    """Which way the fingertip should move.

    Args:
        states: ``(..., 10)``.

    Returns:
        ``(..., 2)`` float32: -1 left, +1 right, and -1 down, +1 up; 0 within ``NEAR``.
    """
    offset = states[..., OFFSET]
    return np.where(offset > NEAR, -1.0, np.where(offset < -NEAR, 1.0, 0.0)).astype(np.float32)


def reached(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the fingertip is within ``REACHED`` of the target at the time limit."""
    del terminated
    return truncated and bool(np.hypot(*state[OFFSET]) < REACHED)


def quadrant(state: Array) -> str:
    """The quadrant of the target, seen from the shoulder."""
    x, y = state[TARGET]
    return f"{'upper' if y >= 0 else 'lower'} {'right' if x >= 0 else 'left'}"


def motion(states: Array) -> Array:
    """States ``(..., 10)`` to how far ``(..., 2)`` the fingertip moves in one step at the current joint velocities."""
    (elbow_x, elbow_y), (finger_x, finger_y) = _links(states)
    first, both = states[..., SPEED_1], states[..., SPEED_1] + states[..., SPEED_2]
    x = -elbow_y * first - (finger_y - elbow_y) * both
    y = elbow_x * first + (finger_x - elbow_x) * both
    return STEP_S * np.stack([x, y], axis=-1)


def _links(states: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Positions of elbow and fingertip."""
    cos_1, cos_2, sin_1, sin_2 = (states[..., i] for i in (COS_1, COS_2, SIN_1, SIN_2))
    elbow = UPPER * cos_1, UPPER * sin_1
    cos_both, sin_both = cos_1 * cos_2 - sin_1 * sin_2, sin_1 * cos_2 + cos_1 * sin_2
    return elbow, (elbow[0] + LOWER * cos_both, elbow[1] + LOWER * sin_both)


def goal_offset(states: Array) -> Array:
    """States ``(..., 10)`` to how far ``(..., 2)`` right of and above the fingertip the target lies."""
    return -states[..., OFFSET]


def scene_path(states: Array) -> Array:
    """States ``(..., 10)`` to the place of the fingertip ``(..., 2)`` in the drawing."""
    return HALF_SCENE + SCENE_SCALE * (states[..., TARGET] + states[..., OFFSET])


def background(env: Any) -> list[Shape]:
    """The target."""
    return [Shape(_circle(env.get_body_com("target")[:2], REACHED), (250, 204, 21), closed=True)]


def figure(env: Any) -> list[Shape]:
    """The arm."""
    joints = [(0.0, 0.0), env.get_body_com("body1")[:2], env.get_body_com("fingertip")[:2]]
    arm = HALF_SCENE + SCENE_SCALE * np.array(joints)
    return [Shape(arm, (165, 148, 249), radius=0.06), Shape(_circle(joints[-1], 0.01), (165, 148, 249), closed=True)]


def _circle(middle: Any, radius: float) -> Array:
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return HALF_SCENE + SCENE_SCALE * (np.asarray(middle) + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1))
