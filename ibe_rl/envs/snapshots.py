"""Snapshot an environment and restore it in another copy: by its own methods, MuJoCo's state or a deep copy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from functools import partial
from typing import Any, Protocol, Self

import gymnasium
import numpy as np
from gymnasium import wrappers
from gymnasium.utils.env_checker import data_equivalence

from ibe_rl.envs.errors import GateError, user_error
from ibe_rl.envs.gate import gate_of
from ibe_rl.envs.masks import sampled_action
from ibe_rl.envs.wrappers import Declared
from ibe_rl.task import PERCEPT
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


class Wrapped(Copied):
    """A game with ``snapshot`` and ``restore`` of its own inside wrappers that change its steps.

    The plain attributes of the wrappers are copied.
    """

    def snapshot(self) -> Any:
        """See ``Stoppable``."""
        return self.game.unwrapped.snapshot(), [deepcopy(_changing(wrapper)) for wrapper in _wrappers(self.game)]

    def restore(self, snapshot: Any, noise: np.random.Generator | None = None) -> None:
        """See ``Stoppable``."""
        state, attributes = snapshot
        self.game.unwrapped.restore(state, noise)
        for wrapper, values in zip(_wrappers(self.game), attributes, strict=True):
            vars(wrapper).update(deepcopy(values))


def _wrappers(game: Any) -> Iterator[Any]:
    while game is not game.unwrapped:
        yield game
        game = game.env


def _changing(wrapper: Any) -> dict[str, Any]:
    return {
        name: value for name, value in vars(wrapper).items() if name != "env" and not isinstance(value, gymnasium.Space)
    }


def stoppable(env: gymnasium.Env[Any, Any]) -> Stoppable | None:
    """The environment below the gate as ``Stoppable``; None if it cannot be restored exactly.

    Its own ``snapshot`` and ``restore`` are trusted, unless a wrapper changes its steps. The other methods are checked
    (``repeats``) once per kind of environment.
    """
    gate = gate_of(env)
    inner: Any = _below_gate(env) if gate else env.unwrapped
    if _has_snapshots(inner) or (gate is None and hasattr(inner, "snapshot")):
        own: Stoppable = inner
        return own
    method = _method(env)
    return None if method is None else method(_below_gate(env))


def _has_snapshots(game: Any) -> bool:
    """Whether it has both methods itself, as a wrapper has not."""
    own = not isinstance(game, gymnasium.Wrapper)
    return own and all(callable(getattr(game, name, None)) for name in ("snapshot", "restore"))


def _below_gate(env: gymnasium.Env[Any, Any]) -> Any:
    """The environment as its user made it, without its time limit."""
    gate = gate_of(env)
    inner: Any = gate.env if gate else env
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
    gate = gate_of(env)
    spec = gate.spec if gate else env.unwrapped.spec
    if spec is None:
        return None
    return f"{spec.id} {spec.kwargs}", partial(gymnasium.make, spec, disable_env_checker=True)


def _find_method(make: Callable[[], Any]) -> type[Copied] | None:
    games = [_below_gate(make()) for _ in range(2)]
    methods: tuple[type[Copied], ...] = (Copied,)
    if _has_snapshots(games[0].unwrapped):
        methods = (Wrapped, Copied)
    elif hasattr(games[0], "model") and hasattr(games[0], "data"):
        methods = (MuJoCo, Copied)
    for method in methods:
        try:
            if repeats(method(games[0]), method(games[1]), exact=method is not Wrapped):
                return method
        except GateError:
            raise  # the environment breaks, whether it is copied or not
        except Exception:  # noqa: S112 - uncopyable objects raise many types of error
            continue
    return None


def step_games(games: Sequence[Stoppable], actions: Iterable[Any]) -> tuple[Array, Array, Array]:
    """Step games in roll-outs.

    Args:
        games: ``N`` copies.
        actions: one for each.

    Returns:
        States ``(N, S)`` float32, percepts ``(N, P)``, and whether they terminated ``(N,)``.

    Raises:
        GateError: if one raises, or gives numbers that are not finite.
    """
    steps = called_in_copy(
        lambda: [game.step(action) for game, action in zip(games, actions, strict=True)], games[0], "step"
    )
    states = np.array([after[0] for after in steps], np.float32)
    if not np.isfinite(states.sum()):
        _refuse_states(states, games)
    percepts = np.array([after[4][PERCEPT] for after in steps]) if PERCEPT in steps[0][4] else states
    return states, percepts, np.array([after[2] for after in steps], bool)


def _refuse_states(states: Array, games: Sequence[Stoppable]) -> None:
    for state in states[~np.isfinite(states).all(axis=-1)]:
        raise GateError(f"{_rolled(games[0])}: the observation is {state.tolist()}; allowed are finite numbers")


def called_in_copy(call: Callable[[], Any], game: Stoppable, name: str) -> Any:
    """What ``call`` of a game gives.

    Raises:
        GateError: if it raises.
    """
    try:
        return call()
    except Exception as error:
        raise GateError(f"{_rolled(game)}: its {name}() raised {user_error(error)}") from None


def _rolled(stoppable_game: Stoppable) -> str:
    game: Any = getattr(stoppable_game, "game", stoppable_game)
    return f"env.id={game.spec.id if game.spec else type(game).__name__}, a roll-out from a snapshot"


def repeats(original: Stoppable, other: Stoppable, steps: int = PROOF_STEPS, exact: bool = True) -> bool:
    """Whether restored copies repeat the original, random draws included.

    Args:
        original: stepped from the start of an episode, with snapshots at intervals.
        other: a copy, in another episode before.
        steps: of each replay, and the latest step of a snapshot.
        exact: bit for bit; False: to 1e-5.
    """
    called_in_copy(lambda: original.reset(seed=1), original, "reset")
    other.reset(seed=2)
    space: Any = getattr(original, "game", original.unwrapped).action_space
    space.seed(3)
    played: list[tuple[Any, Any]] = []
    stopped: list[tuple[int, Any]] = []
    while len(played) < 2 * steps and not (played and played[-1][1][2]):
        if len(played) % max(1, steps // 4) == 0 and len(played) <= steps:
            stopped.append((len(played), original.snapshot()))
        action = sampled_action(space, original)
        played.append(
            (action, deepcopy(called_in_copy(partial(original.step, action), original, "step")[:3]))
        )  # it may change what it gave
    for start, snapshot in stopped:
        other.restore(snapshot)
        if not all(_same(other.step(action)[:3], seen, exact) for action, seen in played[start : start + steps]):
            return False
    return True


def _same(one: Any, other: Any, exact: bool) -> bool:
    return bool(data_equivalence(tuple(one), tuple(other), exact=exact))
