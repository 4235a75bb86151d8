"""The tasks of gymnasium's Pendulum, MountainCar and Acrobot: to swing more or less, until the energy is right.

Their states are gymnasium's observations with the energy added.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ibe_rl.types import Array

ENERGY = -1
UPRIGHT_J, NEAR_J = 5.0, 0.5
"""Energy of the pendulum at rest and upright, 0 at the height of its axle, and what counts as near it."""
BALANCED_RAD, BALANCED_RAD_S = 0.3, 0.5
"""A pendulum that is at most this far from upright, and this fast, at the time limit has succeeded."""
HILL = 1.05
"""The height of the car's goal, with a little to spare; the valley is at -1, and energy is in the same unit."""
TIP_UP_J = 8.0
"""Energy with which the acrobot's tip can get up, 0 at the height of its axle; it hangs with -19.6."""


def pendulum_state(env: Any, observation: Array) -> Array:
    """The observation of the pendulum (a rod of 1 kg and 1 m, gravity of 10 m/s^2) and its energy.

    Args:
        env: not read.
        observation: height and side of its tip in m, angular velocity in rad/s.

    Returns:
        ``(4,)``; the last is the energy in J.
    """
    del env
    height, _, speed = observation
    return np.array([*observation, 5 * height + speed**2 / 6])


def swing_to_upright(states: Array) -> Array:
    """How the swing should change: states ``(..., 4)`` to ``(..., 1)`` float32, -1 less, 0 as it is, +1 more."""
    short = short_of_upright(states)
    return np.where(np.abs(short) > NEAR_J, np.sign(short), 0.0).astype(np.float32)


def short_of_upright(states: Array) -> Array:
    """States ``(..., 4)`` to the energy ``(..., 1)`` in J that is missing to stand upright."""
    return UPRIGHT_J - states[..., ENERGY, None]


def balanced(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the pendulum stands nearly still and upright at the time limit."""
    del terminated
    return truncated and bool(state[0] > np.cos(BALANCED_RAD) and abs(state[2]) < BALANCED_RAD_S)


def car_state(env: Any, observation: Array) -> Array:
    """The observation of the mountain car and its energy.

    Args:
        env: not read.
        observation: x and velocity.

    Returns:
        ``(3,)``; the last is the height to which it could roll.
    """
    del env
    x, velocity = observation
    return np.array([x, velocity, np.sin(3 * x) + 600 * velocity**2])


def swing_to_the_hill(states: Array) -> Array:
    """How the car should swing: states ``(..., 3)`` to ``(..., 1)`` float32, +1 more, 0 as it does."""
    return (short_of_the_hill(states) > 0).astype(np.float32)


def short_of_the_hill(states: Array) -> Array:
    """States ``(..., 3)`` to the energy ``(..., 1)`` that is missing to roll up the hill."""
    return HILL - states[..., ENERGY, None]


def acrobot_state(env: Any, observation: Array) -> Array:
    """The observation of the acrobot (two rods of 1 kg and 1 m, moments of inertia 1 kg m^2) and its energy.

    Args:
        env: not read.
        observation: cosine and sine of the upper link's angle, 0 where it hangs, and of the lower one's to it, and
            their angular velocities in rad/s.

    Returns:
        ``(7,)``; the last is the energy in J.
    """
    del env
    cos_1, sin_1, cos_2, sin_2, speed_1, speed_2 = observation
    cos_both = cos_1 * cos_2 - sin_1 * sin_2
    still = -9.8 * (1.5 * cos_1 + 0.5 * cos_both)
    moving = (3.5 + cos_2) * speed_1**2 / 2 + (1.25 + 0.5 * cos_2) * speed_1 * speed_2 + 1.25 * speed_2**2 / 2
    return np.array([*observation, still + moving])


def swing_the_tip_up(states: Array) -> Array:
    """How the links should swing: states ``(..., 7)`` to ``(..., 1)`` float32, +1 more, 0 as they do."""
    return (short_of_the_top(states) > 0).astype(np.float32)


def short_of_the_top(states: Array) -> Array:
    """States ``(..., 7)`` to the energy ``(..., 1)`` in J that is missing to get the tip up."""
    return TIP_UP_J - states[..., ENERGY, None]


def arrived(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the episode ended before the time limit: with the car on the hill, or the acrobot's tip up."""
    del state, truncated
    return terminated
