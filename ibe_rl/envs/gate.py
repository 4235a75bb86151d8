"""The gate: everything that an environment gives is copied in, checked, and located if it cannot be used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import OrderEnforcing, TimeLimit

from ibe_rl.envs.conversions import UnfitError, as_flag, as_number, shortened, taken
from ibe_rl.envs.errors import GateError, check_beginning, user_error

FLOAT32 = np.dtype(np.float32)
SHORT_ROW = 64
"""Numbers up to which a row is checked in plain Python."""


class Gate(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Lets pass only what can be used; stands directly around a user's environment and keeps its time limit.

    Observations have the shape and dtype of their space, rewards are finite floats, the ends and ``info[success_key]``
    bools; harmless differences are converted. Observations are copied unless the environment makes a new one at each
    step and says so: ``new_observations = True``.

    Args:
        env: the environment; an outermost time limit of gymnasium is replaced by the gate's own.
        label: what the user calls it, as ``env.id=Toy-v0``.
        success_key: key in ``info`` that says whether the episode succeeded; None: it has none.
        names: of the numbers of its observation, for messages.
        task: its own; None: a wrapper around the gate has it.

    Attributes:
        keys_seen: the keys of all infos without ``success_key``.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        label: str,
        success_key: str | None = None,
        names: Sequence[str] = (),
        task: Any = None,
    ):
        self._spec_with_limit = env.spec
        self._limit: float = np.inf
        if type(env) is TimeLimit:
            self._limit, env = env._max_episode_steps, env.env
        super().__init__(env.env if type(env) is OrderEnforcing else env)
        self._label, self._success_key, self._names = label, success_key, names
        self._seed: int | None = None
        self._steps = self._earlier_steps = self._without_key = 0
        self.keys_seen: set[str] = set()
        space = self.env.observation_space
        row = (
            isinstance(space, spaces.Box)
            and space.dtype == np.float32
            and len(space.shape) == 1
            and space.shape[0] <= SHORT_ROW
        )
        self._row = space.shape if row else None  # of the observation that needs no conversion
        self._copies = not getattr(env.unwrapped, "new_observations", False)
        self._has_task = task is not None
        if task is not None:
            self.task = task

    @property
    def spec(self) -> Any:  # type: ignore[override]  # as of gymnasium.Wrapper
        """With the time limit, as gymnasium made it."""
        return self._spec_with_limit

    def never_succeeds(self) -> bool:
        """Whether no info had the success key so far, in at least one step."""
        return 0 < self._without_key == self._earlier_steps + self._steps

    def place(self) -> str:
        """The environment, the episode and the step."""
        seed = "" if self._seed is None else f" of seed {self._seed}"
        return f"{self._label}, episode{seed}, {f'step {self._steps}' if self._steps else 'reset'}"

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """See ``gymnasium.Env``.

        Raises:
            GateError: if it raises or gives what cannot be used.
        """
        self._earlier_steps += self._steps
        self._seed, self._steps = seed, 0
        try:
            given = self.env.reset(seed=seed, options=options)
        except Exception as error:
            raise self._broken("reset", error) from None
        if not isinstance(given, tuple) or len(given) != 2:
            raise self._refused("what reset() gave", given, "an observation and an info")
        if not isinstance(given[1], Mapping):
            raise self._refused("info", given[1], "a dict")
        observation = self._observation(given[0])
        if self._has_task:
            check_beginning(self, self.task, observation)
        return observation, dict(given[1])

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """See ``gymnasium.Env``.

        Raises:
            GateError: if it raises or gives what cannot be used.
        """
        self._steps += 1
        given: Any = None
        try:
            given = self.env.step(action)
            observation, reward, terminated, truncated, info = given
        except Exception as error:
            raise self._misshapen(given) if given is not None else self._broken("step", error) from None
        if (  # nearly all steps need no conversion
            type(observation) is np.ndarray
            and observation.dtype == FLOAT32
            and observation.shape == self._row
            and type(reward) is float
            and isfinite(sum(observation.tolist()) + reward)  # for a short row a sixth of the time of np.isfinite
            and type(terminated) is bool
            and type(truncated) is bool
            and type(info) is dict
            and (self._success_key is None or type(info.get(self._success_key)) is bool)
        ):
            if self._copies:
                observation = observation.copy()
        else:
            observation, reward, terminated, truncated, info = self._converted(given)
        return observation, reward, terminated, truncated or self._steps >= self._limit, info

    def _converted(self, given: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = given
        number = as_number(reward)
        if number is None:
            raise self._refused("the reward", reward, "one finite number")
        ends = self._flag("terminated", terminated), self._flag("truncated", truncated)
        return self._observation(observation), number, *ends, self._info(info)

    def _broken(self, call: str, error: Exception) -> GateError:
        if isinstance(error, GateError):
            return error
        return GateError(f"{self.place()}: its {call}() raised {user_error(error)}")

    def _misshapen(self, given: Any) -> GateError:
        return self._refused("what step() gave", given, "observation, reward, terminated, truncated and info")

    def _refused(self, what: str, value: Any, allowed: str) -> GateError:
        return GateError(f"{self.place()}: {what} is {shortened(value)}; allowed is {allowed}")

    def _observation(self, value: Any) -> Any:
        try:
            return taken(self.env.observation_space, value, "observation", self._names)
        except UnfitError as error:
            raise GateError(f"{self.place()}: {error}") from None

    def _flag(self, what: str, value: Any) -> bool:
        flag = as_flag(value)
        if flag is None:
            raise self._refused(what, value, "True or False")
        return flag

    def _info(self, info: Any) -> dict[str, Any]:
        """The info with a bool under the success key, False if it has none."""
        if not isinstance(info, Mapping):
            raise self._refused("info", info, "a dict")
        key = self._success_key
        if key is None:
            return dict(info)
        if key not in info:
            self._without_key += 1
            self.keys_seen.update(map(str, info))
            return {**info, key: False}
        return {**info, key: self._flag(f"info[{key!r}]", info[key])}


def gate_of(env: Any) -> Gate | None:
    """The gate of an environment; None if it has none."""
    while isinstance(env, gymnasium.Wrapper) and not isinstance(env, Gate):
        env = env.env
    return env if isinstance(env, Gate) else None
