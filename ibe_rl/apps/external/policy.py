"""An externally trained agent as a policy: from stable-baselines3, from TorchRL, or any function.

It depends on observation and action sizes, not on an environment.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from tensordict import TensorDict
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from ibe_rl.runtime.import_string import import_named, raised
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Policy

SB3_KINDS = {
    "DQN": "exploration_fraction",
    "SAC": "target_entropy",
    "TD3": "policy_delay",
    "PPO": "clip_range",
    "A2C": "gae_lambda",
}
"""Algorithms of stable-baselines3 and the setting that identifies each in a saved file; the first match counts."""
ALLOWED = "a .zip of stable-baselines3, or MODULE:NAME of a policy that Python can import"


@dataclass(frozen=True)
class ExternalPolicy:
    """An externally trained policy; see ``ibe_rl.types.Policy``.

    Attributes:
        act: observations ``(N, seen)`` to actions.
        seen: how many numbers of an observation the agent reads: ``S``, or all ``O``.
        actions: the environment's action space, ``Discrete`` or a flat ``Box``.
    """

    act: Callable[[Array], Any]
    seen: int
    actions: gymnasium.Space[Any]

    def __call__(self, observations: Array) -> Array:
        """Observations ``(N, O)`` to actions ``(N,)`` int64 or ``(N, A)`` float32.

        Raises:
            ConfigError: if the agent returns actions outside the action space.
        """
        chosen = _plain(self.act(observations[:, : self.seen]))
        if not fits(chosen, self.actions, len(observations)):
            raise ConfigError(
                f"agent: for {len(observations)} observations it returned {chosen.dtype} of shape {chosen.shape} "
                f"({str(chosen.ravel()[:4])[:80]} …); allowed is one action of {self.actions} each"
            )
        return chosen.astype(np.int64 if isinstance(self.actions, Discrete) else np.float32)


def fits(chosen: Array, actions: gymnasium.Space[Any], count: int) -> bool:
    """True if ``chosen`` is ``count`` actions of the space."""
    if isinstance(actions, Discrete):
        whole = chosen.shape == (count,) and chosen.dtype.kind in "iu"
        return bool(whole and np.all((chosen >= actions.start) & (chosen < actions.start + actions.n)))
    right = chosen.shape == (count, *(actions.shape or ())) and chosen.dtype.kind in "fiu"
    return bool(right and np.isfinite(chosen).all())


def _plain(chosen: Any) -> Array:
    return np.asarray(chosen.detach().cpu() if isinstance(chosen, torch.Tensor) else chosen)


@dataclass(frozen=True)
class _Predicts:
    """An agent or policy of stable-baselines3."""

    model: Any

    def __call__(self, observations: Array) -> Any:
        return self.model.predict(observations, deterministic=True)[0]


@dataclass(frozen=True)
class _OneByOne:
    """A function of a single observation."""

    function: Callable[[Array], Any]

    def __call__(self, observations: Array) -> Array:
        return np.stack([_plain(self.function(observation)) for observation in observations])


@dataclass(frozen=True)
class _ReadsTensorDicts:
    """A policy module of TorchRL, which reads ``observation`` and writes ``action``."""

    module: TensorDictModuleBase
    one_hot: bool

    def __call__(self, observations: Array) -> Array:
        read = TensorDict({"observation": torch.from_numpy(np.ascontiguousarray(observations))}, [len(observations)])
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            action: Array = self.module(read)["action"].cpu().numpy()
        return action.argmax(-1) if self.one_hot and action.ndim == 2 and action.shape[1] > 1 else action


def as_policy(
    agent: Any, task: Task, actions: gymnasium.Space[Any], sees_instruction: bool | None, examples: Array
) -> ExternalPolicy:
    """Wrap an agent as a policy and test it on ``examples``.

    Args:
        agent: a model of stable-baselines3, a policy module of TorchRL, or a function from observations ``(N, ·)`` or
            a single one ``(·,)`` to actions.
        task: the environment's task.
        actions: the environment's action space.
        sees_instruction: whether it reads the instruction after the state; None takes it from the agent.
        examples: observations ``(N, O)`` to test it with, at least two.

    Raises:
        ConfigError: if it does not fit the environment or its observation size is unknown; both sizes are named.
    """
    if not isinstance(actions, Discrete) and not (isinstance(actions, Box) and len(actions.shape) == 1):
        raise ConfigError(f"env: its actions are {actions}; allowed are Discrete or a Box of one dimension")
    seen = _seen(agent, task, sees_instruction)
    check_same_actions("agent", agent, actions)
    act = _act(agent, actions)
    tried = np.ascontiguousarray(examples[:, :seen])
    if not _is_batched(agent, act, actions, tried):
        act = _OneByOne(act)
    policy = ExternalPolicy(act, seen, actions)
    try:
        policy(examples)
    except ConfigError:
        raise
    except Exception as error:  # external code may raise anything
        raise ConfigError(
            f"agent: it fails on an observation of {seen} numbers ({raised(error)}); {_sizes(task)}"
        ) from None
    return policy


def _sizes(task: Task) -> str:
    what = "the observation as one row" if task.parts else "the state"
    return (
        f"allowed is one that reads {what}, {task.percept_size} numbers, or with the instruction and whether "
        f"it was given {task.observation_size}"
    )


def _seen(agent: Any, task: Task, sees_instruction: bool | None) -> int:
    """How many numbers the agent reads."""
    state, whole = task.percept_size, task.observation_size
    declared = getattr(agent, "observation_space", None)
    if declared is None:
        if sees_instruction is None:
            raise ConfigError(
                f"agent_sees_instruction=null: this agent does not declare what it reads; allowed is true for {whole} "
                f"numbers (state, instruction, whether it was given) or false for the state, {state}"
            )
        return whole if sees_instruction else state
    if declared.shape not in ((state,), (whole,)):
        raise ConfigError(f"agent: it reads observations of shape {declared.shape}; {_sizes(task)}")
    sees = declared.shape == (whole,)
    if sees_instruction not in (None, sees):
        raise ConfigError(
            f"agent_sees_instruction={str(sees_instruction).lower()}: the agent says that it reads "
            f"{declared.shape[0]} numbers; allowed is {str(sees).lower()}, or none"
        )
    return whole if sees else state


def check_same_actions(whose: str, declares: Any, actions: gymnasium.Space[Any]) -> None:
    """Compare a declared ``action_space`` with the environment's; without a declaration nothing is checked.

    Raises:
        ConfigError: if they differ; both are named.
    """
    declared = getattr(declares, "action_space", None)
    if declared is None:
        return
    same = (getattr(declared, "n", None), declared.shape) == (getattr(actions, "n", None), actions.shape)
    if type(declared) is not type(actions) or not same:
        raise ConfigError(f"{whose}: its actions are {declared}; allowed are those of the environment, {actions}")


def _act(agent: Any, actions: gymnasium.Space[Any]) -> Callable[[Array], Any]:
    if isinstance(agent, TensorDictModuleBase):
        return _ReadsTensorDicts(deepcopy(agent).eval(), isinstance(actions, Discrete))
    if hasattr(agent, "predict"):
        policy = getattr(agent, "policy", agent)
        if hasattr(policy, "lstm_actor"):
            raise ConfigError("agent: it is recurrent; allowed is a policy without memory")
        return _Predicts(policy)
    if callable(agent):
        return agent
    raise ConfigError(f"agent={agent!r:.80}: allowed is a model of stable-baselines3, a TorchRL policy, or a function")


def _is_batched(agent: Any, act: Callable[[Array], Any], actions: gymnasium.Space[Any], tried: Array) -> bool:
    """False for a function that cannot process a batch of observations."""
    if act is not agent:
        return True
    try:
        return fits(_plain(act(tried)), actions, len(tried))
    except Exception:  # a function of one observation may raise anything on a batch
        return False


def find_agent(name: str) -> Any:
    """Load the agent of that name. Loading runs code from the file, as in that library.

    Args:
        name: a ``.zip`` of stable-baselines3, or ``module:name``.

    Raises:
        ConfigError: if there is none, or the library for it is missing.
    """
    if name.endswith(".zip"):
        return _load_sb3(Path(name))
    _, colon, attribute = name.partition(":")
    if not colon or not attribute:
        raise ConfigError(f"agent={name}: allowed is {ALLOWED}")
    return import_named("agent", name, ALLOWED)


def _load_sb3(path: Path) -> Any:
    try:
        with ZipFile(path) as archive:
            settings = json.loads(archive.read("data"))
    except (OSError, BadZipFile, KeyError, ValueError) as error:
        raise ConfigError(f"agent={path}: no readable model of stable-baselines3 ({error})") from None
    kind = next((name for name, key in SB3_KINDS.items() if key in settings), None)
    if kind is None:
        raise ConfigError(f"agent={path}: allowed are {', '.join(SB3_KINDS)}, or MODULE:NAME of a loaded model")
    try:
        library = importlib.import_module("stable_baselines3")
    except ImportError:
        raise ConfigError(f"agent={path}: needs stable-baselines3; install the extra ibe_rl[sb3]") from None
    try:
        return getattr(library, kind).load(path, device="cpu", custom_objects={"buffer_size": 1})  # no replay memory
    except Exception as error:  # unpickling may raise anything
        raise ConfigError(f"agent={path}: {kind} cannot load it ({' '.join(str(error).split())[:200]})") from None


class EpsilonGreedy:
    """A policy with a share of random actions, so that its episodes include good and bad ones.

    Args:
        policy: followed otherwise.
        share: share of random actions.
        actions: the action space that they are sampled from.
        seed: of the draws.
    """

    def __init__(self, policy: Policy, share: float, actions: gymnasium.Space[Any], seed: int):
        self._policy, self._share, self._actions = policy, share, deepcopy(actions)
        self._random = np.random.default_rng(seed)
        self._actions.seed(seed)

    def __call__(self, observations: Array) -> Array:
        """See ``ibe_rl.types.Policy``."""
        chosen = self._policy(observations)
        for row in np.flatnonzero(self._random.random(len(chosen)) < self._share):
            chosen[row] = self._actions.sample()
        return chosen
