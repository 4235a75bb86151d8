"""Rewards."""

from __future__ import annotations

import numpy as np

from benchmarks.meaning.environments import Reward
from benchmarks.meaning.point_mass import VX, VY, unmixed
from benchmarks.meaning.rules import Rule
from ibe_rl.types import Array


def as_told(rule: Rule, direction: Array, times: float = 1.0) -> Reward:
    """Movement along the direction ``(S,)`` as instructed; the opposite with ``times`` below 0."""

    def reward(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
        return times * float(rule(before)[0] * ((after - before) @ direction[: len(after)]))

    return reward


def a_step(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """1 for each step."""
    return 1.0


def by_lot(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """Noise."""
    return float(random.normal())


def thrift(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """As little force as possible."""
    return -float(np.abs(action).sum())


def rest_of_mass(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """The point mass standing still."""
    return -float(np.abs(unmixed(after)[[VX, VY]]).sum())


def rest_of_car(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """The car standing still."""
    return -10 * abs(float(after[1]))


def energy_of_pendulum(before: Array, action: Array, after: Array, random: np.random.Generator) -> float:
    """What the swing gains in energy."""
    return float(_energy(after) - _energy(before))


def _energy(state: Array) -> float:
    return float(state[2] ** 2 / 6 + 5 * state[0])
