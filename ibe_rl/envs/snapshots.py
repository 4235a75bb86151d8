"""Stop a game in one copy and take it up in another: by the game itself, by MuJoCo's state, by a deep copy."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Protocol, Self

import gymnasium
import numpy as np
from gymnasium import wrappers
from gymnasium.envs.registration import EnvSpec

from ibe_rl.envs.wrappers import Declared
from ibe_rl.types import Array

AROUND = (wrappers.TimeLimit, wrappers.OrderEnforcing, wrappers.PassiveEnvChecker, Declared)
"""What is around a game without being part of it."""
PROOF_STEPS = 30
"""How far a game that was taken up must repeat the original; it is stopped as far into the episode."""


class Stoppable(Protocol):
    """A game, without its time limit, that can be stopped, and taken up again in this copy or in another one."""

    @property
    def unwrapped(self) -> Any:
        """Itself."""

    def reset(self, *, seed: int | None = None) -> Any:
        """Begin an episode; once before ``restore``."""

    def step(self, action: Any) -> Any:
        """As ``gymnasium.Env.step``."""

    def snapshot(self) -> Any:
        """Copy all that the steps of the game read."""

    def restore(self, snapshot: Any, noise: np.random.Generator | None = None) -> None:
        """Take the game up where ``snapshot`` left it, which stays as it is.

        Args:
            snapshot: also of another copy.
            noise: generator of the game's chance from here on; None repeats the draws of the original.
        """


class Copied:
    """A game that is all Python, stopped by a deep copy."""

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
    """One of gymnasium's MuJoCo environments: what MuJoCo integrates, and plain attributes kept beside it."""

    def snapshot(self) -> tuple[Array, dict[str, Any]]:
        """See ``Stoppable``."""
        import mujoco  # an extra

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
        mujoco.mj_forward(self.game.model, self.game.data)  # what follows from it, such as where the bodies are
        mujoco.mj_setState(self.game.model, self.game.data, state, kind)  # the solver's start, which that has moved
        if noise is not None:
            self.game.np_random = noise


def _plain(value: Any) -> bool:
    if isinstance(value, dict | list | tuple):
        return all(map(_plain, value.values() if isinstance(value, dict) else value))
    return value is None or isinstance(value, bool | int | float | str | np.ndarray | np.generic | np.random.Generator)


def stoppable(env: gymnasium.Env[Any, Any]) -> Stoppable | None:
    """The game below ``env`` as one that can be stopped; None if it cannot be taken up again exactly.

    A game's own ``snapshot`` and ``restore`` are trusted; the other ways are held against the game itself
    (``repeats``), once for each kind of environment.
    """
    if hasattr(env.unwrapped, "snapshot"):
        own: Stoppable = env.unwrapped  # type: ignore[assignment]
        return own
    way = _way(env)
    return None if way is None else way(_inside(env))


def _inside(env: gymnasium.Env[Any, Any]) -> Any:
    inner: Any = env
    while isinstance(inner, AROUND):
        inner = inner.env
    return inner


_ways: dict[tuple[str, str], type[Copied] | None] = {}


def _way(env: gymnasium.Env[Any, Any]) -> type[Copied] | None:
    spec = env.unwrapped.spec
    if spec is None:
        return None
    kind = (spec.id, repr(spec.kwargs))
    if kind not in _ways:
        _ways[kind] = _found(spec)
    return _ways[kind]


def _found(spec: EnvSpec) -> type[Copied] | None:
    games = [_inside(gymnasium.make(spec, disable_env_checker=True)) for _ in range(2)]
    for way in (MuJoCo, Copied) if hasattr(games[0], "model") and hasattr(games[0], "data") else (Copied,):
        try:
            if repeats(way(games[0]), way(games[1])):
                return way
        except Exception:  # noqa: S112 - what cannot be copied, such as an engine's bodies, says so in many ways
            continue
    return None


def repeats(original: Stoppable, other: Stoppable, steps: int = PROOF_STEPS) -> bool:
    """Whether a game that is taken up in another copy repeats the original to the last bit, chance included.

    Args:
        original: is played from its beginning and stopped now and then.
        other: a copy, which played something else before.
        steps: of each replay; the last stop is as far into the episode.
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
    return np.array_equal(one[0], other[0]) and one[1:3] == other[1:3]
