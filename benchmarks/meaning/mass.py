"""A point mass in the plane of which only a linear mixture is seen: no state dimension is what the words are about."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl.types import Array

MIXTURE = np.array([[0.8, 0.5, -0.3, 0.2], [-0.4, 0.9, 0.6, 0.1], [0.3, -0.2, 0.7, -0.8], [0.5, 0.4, 0.2, 0.9]])
"""What is seen ``(4,)`` is this times ``(x, vx, y, vy)``."""
UNMIXED = np.linalg.inv(MIXTURE)
"""Its rows are the directions in what is seen along which x, vx, y and vy alone rise."""
X, VX, Y, VY = range(4)
STEP_S = 0.1
DRAG = 0.3
GUSTS = 0.5
"""Standard deviation of the random accelerations."""


def unmixed(seen: Array) -> Array:
    """What is seen ``(..., 4 or more)`` to ``(..., 4)``: x, vx, y, vy."""
    found: Array = seen[..., :4] @ UNMIXED.T
    return found


class PointMass(gymnasium.Env[Array, Array]):
    """A mass that is accelerated along x and y, in gusts and drag; it begins anywhere near the middle."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-np.inf, np.inf, (4,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._state = np.zeros(4)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin at a random place with a random velocity."""
        super().reset(seed=seed, options=options)
        self._state = self.np_random.uniform([-3, -0.5, -3, -0.5], [3, 0.5, 3, 0.5])
        return self._seen(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Accelerate, then move; it never ends by itself and pays nothing."""
        velocity = self._state[[VX, VY]]
        push = np.clip(action, -1, 1) + self.np_random.normal(0, GUSTS, 2) - DRAG * velocity
        velocity = velocity + STEP_S * push
        self._state = np.array([0, velocity[0], 0, velocity[1]]) + [1, 0, 1, 0] * self._state
        self._state[[X, Y]] += STEP_S * velocity
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> Array:
        return (MIXTURE @ self._state).astype(np.float32)
