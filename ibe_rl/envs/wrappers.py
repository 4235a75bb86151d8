"""Wrappers that add a declared task, and the instruction to the observation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, observe

SUCCESS = "success"
"""Key in ``info`` of a declared success function."""


class Declared(gymnasium.Wrapper[Array, Any, Any, Any]):
    """An environment with a task declared in a config.

    States are float32 rows; ``info["success"]`` at each step is whether the episode ended in success, and
    ``info["ibe_rl/percept"]`` what the agent perceives, where that is not the state.

    Args:
        env: with its time limit.
        task: as declared.
        success: (last state ``(S,)``, terminated, truncated) to bool; None: read from ``info`` under the task's key,
            else False.
        draw: functions from the environment to shapes, under "background" and "figure"; others are its own.
        sense: reads its observations (``ibe_rl.envs.sensing.Sense``).
        again: for an environment that gymnasium cannot make by its id: what tells its kind, and what makes another.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        task: Task,
        success: Callable[[Array, bool, bool], bool] | None = None,
        draw: dict[str, Callable[[Any], Any]] | None = None,
        again: tuple[str, Callable[[], Any]] | None = None,
        *,
        sense: Callable[[Any, Any], tuple[Array, dict[str, Any]]],
    ):
        super().__init__(env)
        self.again = again
        self.sense = sense
        self.task, self._success, self._draw = task, success, draw or {}
        self.observation_space = spaces.Box(-np.inf, np.inf, (len(task.state_names),), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """See ``gymnasium.Env``."""
        seen, info = self.env.reset(seed=seed, options=options)
        state, percept = self.sense(self.unwrapped, seen)
        return state, {**info, **percept, self.task.success_key: False}

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """See ``gymnasium.Env``."""
        seen, reward, terminated, truncated, info = self.env.step(action)
        state, percept = self.sense(self.unwrapped, seen)
        info = {**info, **percept} if percept else info
        if self._success is not None:
            info = {**info, SUCCESS: bool(self._success(state, bool(terminated), bool(truncated)))}
        elif self.task.success_key not in info:
            info = {**info, self.task.success_key: False}
        return state, float(reward), bool(terminated), bool(truncated), info

    def background(self) -> list[Any]:
        """The static shapes of the drawing."""
        return self._shapes("background")

    def figure(self) -> list[Any]:
        """The moving shapes of the drawing."""
        return self._shapes("figure")

    def _shapes(self, part: str) -> list[Any]:
        if part in self._draw:
            return list(self._draw[part](self.unwrapped))
        return list(self.env.get_wrapper_attr(part)()) if self.env.has_wrapper_attr(part) else []


class Instructed(gymnasium.Wrapper[Array, Any, Array, Any], RecordConstructorArgs):
    """Appends the rule's instruction, and that it was given, to the state.

    Args:
        env: declares a task and observes its state.

    Raises:
        ConfigError: if it declares none.
    """

    def __init__(self, env: gymnasium.Env[Array, Any]):
        RecordConstructorArgs.__init__(self)  # so that its spec can recreate it
        gymnasium.Wrapper.__init__(self, env)
        task = getattr(env.unwrapped, "task", None)
        if not isinstance(task, Task):
            raise ConfigError(f"env={env}: it declares no task; allowed is one with an attribute of type Task")
        if task.state is not None:
            raise ConfigError(f"env={env}: its task makes a state of the observation; allowed is one that observes it")
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
