"""The task of gymnasium-robotics' FetchReach, a robot arm that brings its gripper to a goal in the air (MuJoCo).

An instruction has three components: left or right, down or up, back or forward, all as seen from behind the robot. The
goal is drawn for each episode. Lengths are metres; the drawing shows what is seen from behind, in units of 5 cm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ibe_rl.task import Shape
from ibe_rl.types import Array

AT_GOAL_M = 0.03
"""Within this distance along an axis the instruction is to stay."""
AXES, SIGNS = [1, 2, 0], np.array([-1.0, 1.0, 1.0])
"""MuJoCo's x points ahead, y to the left and z up; the state has right, up, ahead."""
FROM_GOAL, SPEED = slice(0, 3), slice(3, 6)
HALF_VIEW, PER_M = 8.0, 20.0
GOAL_RADIUS, GRIPPER_RADIUS = 0.05, 0.01


def gripper_state(env: Any, observation: dict[str, Array]) -> Array:
    """Where the gripper is, as seen from the goal, and its velocity.

    Args:
        env: not read.
        observation: of FetchReach.

    Returns:
        ``(6,)``: how far right of, above and ahead of the goal, in m; the velocity that way, in m a step.
    """
    del env
    offset = observation["achieved_goal"] - observation["desired_goal"]
    velocity = observation["observation"][5:8]
    return np.concatenate([SIGNS * offset[AXES], SIGNS * velocity[AXES]])


def towards_goal(states: Array) -> Array:
    """Which way the gripper should move.

    Args:
        states: ``(..., 6)``.

    Returns:
        ``(..., 3)`` float32: -1 left, +1 right; -1 down, +1 up; -1 back, +1 forward; 0 within ``AT_GOAL_M``.
    """
    offset = states[..., FROM_GOAL]
    return np.where(np.abs(offset) > AT_GOAL_M, -np.sign(offset), 0.0).astype(np.float32)


def gripper_motion(states: Array) -> Array:
    """States ``(..., 6)`` to how far ``(..., 3)`` the gripper moves in one step at the current velocity."""
    return states[..., SPEED]


def goal_from_gripper(states: Array) -> Array:
    """States ``(..., 6)`` to how far ``(..., 3)`` right of, above and ahead of the gripper the goal lies."""
    return -states[..., FROM_GOAL]


def seen_from_behind(states: Array) -> Array:
    """States ``(..., 6)`` to the place of the gripper ``(..., 2)`` in the drawing, whose middle is the goal."""
    return HALF_VIEW + PER_M * states[..., :2]


def goal_disc(env: Any) -> list[Shape]:
    """The goal, as large as counts for a success."""
    del env
    return [Shape(_disc(np.zeros(2), GOAL_RADIUS), (250, 204, 21), closed=True)]


def gripper_disc(env: Any) -> list[Shape]:
    """The gripper."""
    state = gripper_state(env, env._get_obs())
    return [Shape(_disc(state[:2], GRIPPER_RADIUS), (165, 148, 249), closed=True)]


def _disc(middle: Array, radius: float) -> Array:
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return HALF_VIEW + PER_M * (middle + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1))
