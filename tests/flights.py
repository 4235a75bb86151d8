"""Flights of the lander by hand-written pilots."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.box2d.lunar_lander import heuristic

from ibe_rl.envs import LANDER_ID
from ibe_rl.types import Array

Pilot = Callable[[Any, Array], Any]


def make(**kwargs: Any) -> Any:
    return gymnasium.make(LANDER_ID, disable_env_checker=True, **kwargs)


def aimed(x: float = 0.0, y: float = 0.0) -> Pilot:
    """Gymnasium's rule of thumb, heading for a point that lies ``x`` and ``y`` from the pad."""

    def pilot(env: Any, state: Array) -> Any:
        seen = state[:8].copy()
        seen[0] -= state[8] + x
        seen[1] -= y
        action = heuristic(env, seen)
        return np.asarray(action, np.float32) if env.unwrapped.continuous else int(action)

    return pilot


def erratic(seed: int, share: float) -> Pilot:
    random, steady = np.random.default_rng(seed), aimed()
    return lambda env, state: int(random.integers(4)) if random.random() < share else steady(env, state)


def fly(env: Any, pilot: Pilot, **reset: Any) -> list[tuple[Array, float, bool, bool, dict[str, Any]]]:
    """Fly one episode; what ``step`` returned, step by step."""
    state, _ = env.reset(**reset)
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(pilot(env, state)))
        state = steps[-1][0]
    return steps


def ground(env: Any) -> Array:
    """Corners ``(P, 2)`` of the ground that the physics knows, in units of the state (x) and metres."""
    edges = [fixture.shape.vertices for fixture in env.unwrapped.moon.fixtures][1:]  # the first is the bottom
    corners = np.array([edges[0][0]] + [right for _, right in edges])
    return np.column_stack([corners[:, 0] / 10 - 1, corners[:, 1]])
