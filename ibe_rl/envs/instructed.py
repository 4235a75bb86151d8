"""An environment whose observation says what the instructor's rule says: to train another library's agent in."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, observe


class Instructed(gymnasium.Wrapper[Array, Any, Array, Any], RecordConstructorArgs):
    """Writes the rule's instruction, and that it was given, behind the state: what the agents here read.

    Args:
        env: an environment that declares a task, with its state as its observation.

    Raises:
        ConfigError: if it declares none.
    """

    def __init__(self, env: gymnasium.Env[Array, Any]):
        RecordConstructorArgs.__init__(self)  # so that its spec can make it again
        gymnasium.Wrapper.__init__(self, env)
        task = getattr(env.unwrapped, "task", None)
        if not isinstance(task, Task):
            raise ConfigError(f"env={env}: it declares no task; allowed is one with an attribute of type Task")
        states: Any = env.observation_space
        edge = np.ones(task.instruction_size, np.float32)
        self._task = task
        self.observation_space = spaces.Box(
            observe(states.low, -edge, np.zeros(1)), observe(states.high, edge, np.ones(1))
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; observations are ``(O,)``."""
        state, info = self.env.reset(seed=seed, options=options)
        return self._seen(state), info

    def step(self, action: Any) -> tuple[Array, Any, bool, bool, dict[str, Any]]:
        """Step the environment."""
        state, reward, terminated, truncated, info = self.env.step(action)
        return self._seen(state), reward, terminated, truncated, info

    def _seen(self, state: Array) -> Array:
        return observe(state, self._task.rule(state), np.ones(1, np.float32))
