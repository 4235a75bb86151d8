"""Snapshot an environment and restore it in another copy: by its own methods, MuJoCo's state or a deep copy."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, Protocol, Self

import gymnasium
import numpy as np
from gymnasium import wrappers
from gymnasium.utils.env_checker import data_equivalence

from ibe_rl.envs.wrappers import Declared
from ibe_rl.types import Array

AROUND = (wrappers.TimeLimit, wrappers.OrderEnforcing, wrappers.PassiveEnvChecker, Declared)
"""Wrappers that are not part of the environment's own state."""
PROOF_STEPS = 30
"""Steps of a check replay, and the latest step of a snapshot in it."""


class Stoppable(Protocol):
    """An environment, without its time limit, that can be snapshot and restored, also in another copy."""

    @property
    def unwrapped(self) -> Any:
        """Itself."""

    def reset(self, *, seed: int | None = None) -> Any:
        """Begin an episode; required once before ``restore``."""

    def step(self, action: Any) -> Any:
        """As ``gymnasium.Env.step``."""

    def snapshot(self) -> Any:
        """Copy all that ``step`` reads."""

    def restore(self, snapshot: Any, noise: np.random.Generator | None = None) -> None:
        """Continue from ``snapshot``, which is not changed.

        Args:
            snapshot: also of another copy.
            noise: random generator from here on; None repeats the original's draws.
        """


class Copied:
    """A pure Python environment, snapshot by a deep copy."""

    def __init__(self, game: Any):
        self.game = game

    @property
    def unwrapped(self) -> Self:
        """See ``Stoppable``."""
        return self

    def reset(self, *, seed: int | None = None) -> Any:
        """See ``Stoppable``."""
        return self.game.reset(seed=seed)

    def step(self, action: Any) -> Any:
        """See ``Stoppable``."""
        return self.game.step(action)

    def snapshot(self) -> Any:
        """See ``Stoppable``."""
        return deepcopy(self.game)

    def restore(self, snapshot: Any, noise: np.random.Generator | None = None) -> None:
        """See ``Stoppable``."""
        self.game = deepcopy(snapshot)
        if noise is not None:
            self.game.unwrapped.np_random = noise


class MuJoCo(Copied):
    """One of gymnasium's MuJoCo environments: MuJoCo's integration state and plain attributes."""

    def snapshot(self) -> tuple[Array, dict[str, Any]]:
        """See ``Stoppable``."""
        import mujoco  # an optional dependency

        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.game.model, kind))
        mujoco.mj_getState(self.game.model, self.game.data, state, kind)
        return state, {name: deepcopy(value) for name, value in vars(self.game).items() if _plain(value)}

    def restore(self, snapshot: Any, noise: np.random.Generator | None = None) -> None:
        """See ``Stoppable``."""
        import mujoco

        kind, (state, attributes) = mujoco.mjtState.mjSTATE_INTEGRATION, snapshot
        vars(self.game).update(deepcopy(attributes))
        mujoco.mj_setState(self.game.model, self.game.data, state, kind)
        mujoco.mj_forward(self.game.model, self.game.data)  # recomputes derived values such as body positions
        mujoco.mj_setState(self.game.model, self.game.data, state, kind)  # mj_forward changes the solver's warm start
        if noise is not None:
            self.game.np_random = noise


def _plain(value: Any) -> bool:
    if isinstance(value, dict | list | tuple):
        return all(map(_plain, value.values() if isinstance(value, dict) else value))
    return value is None or isinstance(value, bool | int | float | str | np.ndarray | np.generic | np.random.Generator)


def stoppable(env: gymnasium.Env[Any, Any]) -> Stoppable | None:
    """The environment below the wrappers as ``Stoppable``; None if it cannot be restored exactly.

    Its own ``snapshot`` and ``restore`` are trusted. The other methods are checked (``repeats``) once per kind of
    environment.
    """
    if hasattr(env.unwrapped, "snapshot"):
        own: Stoppable = env.unwrapped  # type: ignore[assignment]  # it has what is asked for
        return own
    method = _method(env)
    return None if method is None else method(_unwrapped(env))


def _unwrapped(env: gymnasium.Env[Any, Any]) -> Any:
    inner: Any = env
    while isinstance(inner, AROUND):
        inner = inner.env
    return inner


_methods: dict[str, type[Copied] | None] = {}


def _method(env: gymnasium.Env[Any, Any]) -> type[Copied] | None:
    found = _another(env)
    if found is None:
        return None
    kind, make = found
    if kind not in _methods:
        _methods[kind] = _find_method(make)
    return _methods[kind]


def _another(env: gymnasium.Env[Any, Any]) -> tuple[str, Callable[[], Any]] | None:
    """What tells the kind of an environment, and what makes another of it; None if nothing does."""
    if isinstance(env, Declared) and env.again is not None:
        return env.again
    spec = env.unwrapped.spec
    if spec is None:
        return None
    return f"{spec.id} {spec.kwargs}", partial(gymnasium.make, spec, disable_env_checker=True)


def _find_method(make: Callable[[], Any]) -> type[Copied] | None:
    games = [_unwrapped(make()) for _ in range(2)]
    for method in (MuJoCo, Copied) if hasattr(games[0], "model") and hasattr(games[0], "data") else (Copied,):
        try:
            if repeats(method(games[0]), method(games[1])):
                return method
        except Exception:  # noqa: S112 - uncopyable objects raise many types of error
            continue
    return None


def repeats(original: Stoppable, other: Stoppable, steps: int = PROOF_STEPS) -> bool:
    """Whether restored copies repeat the original bit for bit, random draws included.

    Args:
        original: stepped from the start of an episode, with snapshots at intervals.
        other: a copy, in another episode before.
        steps: of each replay, and the latest step of a snapshot.
    """
    original.reset(seed=1)
    other.reset(seed=2)
    space: Any = getattr(original, "game", original.unwrapped).action_space
    space.seed(3)
    played: list[tuple[Any, Any]] = []
    stopped: list[tuple[int, Any]] = []
    while len(played) < 2 * steps and not (played and played[-1][1][2]):
        if len(played) % max(1, steps // 4) == 0 and len(played) <= steps:
            stopped.append((len(played), original.snapshot()))
        action = space.sample()
        played.append((action, original.step(action)))
    for start, snapshot in stopped:
        other.restore(snapshot)
        if not all(_same(other.step(action), seen) for action, seen in played[start : start + steps]):
            return False
    return True


def _same(one: Any, other: Any) -> bool:
    return data_equivalence(one[0], other[0], exact=True) and one[1:3] == other[1:3]
