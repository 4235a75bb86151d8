"""From what an environment observes, of any space, to its state and to the percept of the agent, both rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.spaces.utils import flatten

from ibe_rl.runtime.printed import raised
from ibe_rl.task import FLAGS, IMAGE, NUMBERS, PERCEPT, Part
from ibe_rl.types import Array, ConfigError

READ_SPACES = "Box, Discrete, MultiDiscrete, MultiBinary, and Dict and Tuple of these"
StateFunction = Callable[[Any, Any], Any]
"""(environment without wrappers, its observation) to the state ``(S,)``."""


class Sense:
    """Reads the observations of one environment.

    Without a function the state is the observation, in a row, and so is the percept. With one the percept is the
    observation: the numbers of its parts one after another, categories as flags.

    Args:
        env: observes any space.
        state: the function; None: the observation is the state.
        observes: keys of a Dict that the percept consists of; empty: all.

    Attributes:
        parts: of the percept; empty where it is the state.
        space: of the observation that the percept is made of.
        as_it_is: whether observations are float32 rows and states already.

    Raises:
        ConfigError: if an observation cannot be read.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], state: StateFunction | None = None, observes: Sequence[str] = ()):
        self._name = env.spec.id if env.spec is not None else type(env.unwrapped).__name__
        self.space, self._state, self._size = self._chosen(env.observation_space, observes), state, -1
        self.parts: tuple[Part, ...] = ()
        if state is not None:
            self.parts = tuple(self._parts(self.space, ""))
        elif not isinstance(self.space, spaces.Box) or is_image(self.space) or observes:
            raise ConfigError(
                f"env.task.state=null with env.id={self._name}: it observes {self.space!s:.200}, which is no row of "
                "numbers; allowed is module:name of a function from the environment and its observation to a row"
            )
        self.as_it_is = not self.parts and len(self.space.shape or ()) == 1 and self.space.dtype == np.float32
        self._type = np.float32 if any(part.kind == NUMBERS for part in self.parts) else np.uint8

    def __call__(self, game: Any, seen: Any) -> tuple[Array, dict[str, Any]]:
        """Read an observation.

        Args:
            game: the environment without wrappers.
            seen: its observation.

        Returns:
            The state ``(S,)`` float32; entries of ``info``, with the percept where it is not the state.

        Raises:
            ConfigError: if the function gives no row, or one of another length than before.
        """
        if self._state is None:
            return np.asarray(seen, np.float32).reshape(-1), {}
        state = np.array(self._state(game, seen), np.float32)
        self._size = state.size if self._size < 0 else self._size
        if state.shape != (self._size,) or not self._size:
            raise ConfigError(
                f"env.task.state with env.id={self._name}: it returned an array of shape {state.shape}; allowed is one "
                f"row of numbers{f', {self._size} of them as before' if state.ndim == 1 and self._size else ''}"
            )
        return state, {PERCEPT: np.asarray(flatten(self.space, self._kept(seen)), self._type)}

    def states(self, env: gymnasium.Env[Any, Any]) -> int:
        """How many numbers a state has; the environment is reset to ask the function.

        Raises:
            ConfigError: if the function raises, or gives no row.
        """
        if self._state is None:
            return int(np.prod(self.space.shape or ()))
        try:
            return len(self(env.unwrapped, env.reset(seed=0)[0])[0])
        except ConfigError:
            raise
        except Exception as error:  # user code may raise anything
            raise ConfigError(f"env.task.state with env.id={self._name}: it raised {raised(error)}") from None

    def _kept(self, seen: Any) -> Any:
        return {key: seen[key] for key in self.space.spaces} if isinstance(self.space, spaces.Dict) else seen

    def _chosen(self, space: gymnasium.Space[Any], observes: Sequence[str]) -> gymnasium.Space[Any]:
        """The space, or these keys of it."""
        if not observes:
            return space
        known = list(space.spaces) if isinstance(space, spaces.Dict) else []
        if unknown := [key for key in observes if key not in known]:
            raise ConfigError(
                f"env.task.observes={list(observes)} with env.id={self._name}: {unknown[0]} is no key of its "
                f"observation; allowed are {', '.join(known) or 'none, as it is no Dict'}"
            )
        assert isinstance(space, spaces.Dict)
        return spaces.Dict([(key, space[key]) for key in observes])

    def _parts(self, space: Any, name: str) -> Iterator[Part]:
        """The parts of a space, in the order in which gymnasium flattens it."""
        if isinstance(space, spaces.Dict):
            for key, one in space.spaces.items():
                yield from self._parts(one, f"{name}/{key}".lstrip("/"))
        elif isinstance(space, spaces.Tuple):
            for number, one in enumerate(space.spaces):
                yield from self._parts(one, f"{name}/{number}".lstrip("/"))
        elif isinstance(space, spaces.Box):
            yield _box(space, name)
        elif isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary):
            yield Part(name, FLAGS, (spaces.flatdim(space),))
        else:
            keys = list(self.space.spaces) if isinstance(self.space, spaces.Dict) else []
            others = [key for key in keys if key != name.partition("/")[0]]
            rather = f", or env.task.observes=[{','.join(others)}]" if others else ""
            raise ConfigError(
                f"env.id={self._name}: it observes {f'{name}: ' if name else ''}{space!s:.100}; allowed are "
                f"{READ_SPACES}{rather}"
            )


def is_image(space: spaces.Box) -> bool:
    """Whether it holds bytes in two or three dimensions."""
    return space.dtype == np.uint8 and len(space.shape) in (2, 3)


def _box(space: spaces.Box, name: str) -> Part:
    if not is_image(space):
        return Part(name, NUMBERS, space.shape)
    shape = space.shape if len(space.shape) == 3 else (*space.shape, 1)
    if shape[0] < shape[2]:
        return Part(name, IMAGE, (*shape[1:], shape[0]), channels_first=True)
    return Part(name, IMAGE, shape)


class Sensed:
    """A copy of an environment to predict in, whose steps give states and percepts; see ``Stoppable``.

    Args:
        game: as ``stoppable`` finds it.
        sense: of the environment.
    """

    def __init__(self, game: Any, sense: Sense):
        self._copy, self._sense = game, sense
        self.restore, self.snapshot, self.reset = game.restore, game.snapshot, game.reset

    @property
    def unwrapped(self) -> Any:
        """Itself."""
        return self

    @property
    def game(self) -> Any:
        """The environment that is stepped."""
        return getattr(self._copy, "game", self._copy)

    def step(self, action: Any) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """As ``gymnasium.Env.step``."""
        seen, reward, terminated, truncated, info = self._copy.step(action)
        state, percept = self._sense(self.game.unwrapped, seen)
        return state, reward, terminated, truncated, {**info, **percept}
