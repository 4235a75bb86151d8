"""A cart on a line that is pushed left or right: dynamics that fit on one line, and logs of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Moment

POSITION, SPEED, GOAL, BEYOND = range(4)
END = 2.0
"""The cart falls off there."""
Push = Callable[[np.random.Generator], float]


def after(state: Array, push: float) -> Array:
    """One step: the speed moves the cart, the push changes the speed; the flag says that it is beyond 1."""
    position = state[POSITION] + 0.1 * state[SPEED]
    return np.array([position, state[SPEED] + 0.2 * push, state[GOAL], position > 1], np.float32)


def drive(state: Array, pushes: list[float]) -> Array:
    """States ``(T + 1, 4)``; it ends where the cart falls off."""
    states = [np.array(state, np.float32)]
    for push in pushes:
        states.append(after(states[-1], push))
        if states[-1][POSITION] > END:
            break
    return np.array(states)


def logged(folder: Path, continuous: bool = False, episodes: int = 300, seed: int = 0) -> TrajectoryLog:
    """A log of carts pushed at random, by -1, 0 or 1, which are the actions 0, 1 and 2, or by any number between."""
    random, log = np.random.default_rng(seed), TrajectoryLog(folder, 40_000, ["cart"])
    for number in range(episodes):
        pushes = random.uniform(-1, 1, 40) if continuous else random.integers(-1, 2, 40).astype(float)
        start = np.array([random.uniform(-2, 1.9), random.uniform(-0.7, 1.2), number % 2, 0], np.float32)
        start[BEYOND] = start[POSITION] > 1
        states = drive(start, pushes.tolist())
        count = len(states) - 1
        done = np.arange(count) == count - 1
        actions = pushes[:count, None].astype(np.float32) if continuous else pushes[:count].astype(int) + 1
        steps = {
            "state": states[:-1],
            "next_state": states[1:],
            "action": actions,
            "reward": np.zeros(count, np.float32),
            "instruction": np.zeros((count, 1), np.float32),
            "given": np.ones(count, bool),
            "done": done,
            "terminated": done & (states[-1, POSITION] > END),
            "success": np.zeros(count, bool),
        }
        log.add({name: column[None] for name, column in steps.items()}, lambda _: "cart")
    return log


def moment(position: float, speed: float = 0.0, goal: float = 1.0) -> Moment:
    """Without a snapshot."""
    return Moment(np.array([position, speed, goal, position > 1], np.float32), np.zeros(1, np.float32), True)


def right(observations: Array) -> Array:
    """Push to the right, always."""
    return np.full(len(observations), 2)


def coast(observations: Array) -> Array:
    """Do not push."""
    return np.ones(len(observations), int)
