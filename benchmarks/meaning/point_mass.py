"""A point mass in the plane, observed as a linear mixture: no single state dimension is what the words are about."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl.types import Array

MIXTURE = np.array([[0.8, 0.5, -0.3, 0.2], [-0.4, 0.9, 0.6, 0.1], [0.3, -0.2, 0.7, -0.8], [0.5, 0.4, 0.2, 0.9]])
"""The observation ``(4,)`` is this times ``(x, vx, y, vy)``."""
UNMIXED = np.linalg.inv(MIXTURE)
"""Its rows are the observation axes of x, vx, y and vy."""
X, VX, Y, VY = range(4)
STEP_S = 0.1
DRAG = 0.3
GUSTS = 0.5
"""Standard deviation of the random accelerations."""


def unmixed(seen: Array) -> Array:
    """Observations ``(..., 4 or more)`` to ``(..., 4)``: x, vx, y, vy."""
    found: Array = seen[..., :4] @ UNMIXED.T
    return found


class PointMass(gymnasium.Env[Array, Array]):
    """A mass that is accelerated along x and y, with noise and drag."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(-np.inf, np.inf, (4,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._state = np.zeros(4)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Draw a position and a velocity."""
        super().reset(seed=seed, options=options)
        self._state = self.np_random.uniform([-3, -0.5, -3, -0.5], [3, 0.5, 3, 0.5])
        return self._seen(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Accelerate, then move; it never terminates and the reward is 0."""
        velocity = self._state[[VX, VY]]
        push = np.clip(action, -1, 1) + self.np_random.normal(0, GUSTS, 2) - DRAG * velocity
        velocity = velocity + STEP_S * push
        self._state = np.array([0, velocity[0], 0, velocity[1]]) + [1, 0, 1, 0] * self._state
        self._state[[X, Y]] += STEP_S * velocity
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> Array:
        return (MIXTURE @ self._state).astype(np.float32)
