"""An externally trained agent as a policy: from stable-baselines3, from TorchRL, or any function.

It depends on observation and action sizes, not on an environment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from gymnasium.spaces.utils import flatdim
from tensordict.nn import TensorDictModuleBase

from ibe_rl.apps.external.actions import bounded, check_action_space, check_same_actions, fits, shaped
from ibe_rl.apps.external.adapters import (
    Adapter,
    Batched,
    KeyStatistics,
    Memories,
    Normalised,
    OneByOne,
    Predicts,
    PredictsMasked,
    PredictsRecurrently,
    ReadsTensorDicts,
    Stacked,
    plain_array,
)
from ibe_rl.apps.external.reading import Reading, of_parts
from ibe_rl.envs.acting import Acting
from ibe_rl.envs.masks import sampled_action
from ibe_rl.runtime.printed import raised
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Policy

_CHANCE = (
    "note: the agent answers the same observations differently from call to call. It draws by chance, or it has a "
    "memory of its own, which its predicted futures cannot begin with"
)


@dataclass(frozen=True)
class ExternalPolicy:
    """An externally trained policy; see ``ibe_rl.envs.acting.PolicyWithMemory``.

    Attributes:
        agent: how it is called.
        seen: how many numbers of an observation the agent reads: ``S``, or all ``O``.
        actions: the environment's action space.
        clipped: one outside the bounds, for each call with such actions; they are clipped.
        notes: lines about it that a user should read.
    """

    agent: Adapter
    seen: int
    actions: gymnasium.Space[Any]
    clipped: list[float] = field(default_factory=list, compare=False)
    notes: list[str] = field(default_factory=list, compare=False)

    def __call__(self, observations: Array) -> Array:
        """Observations ``(N, O)`` at the beginning of episodes to actions ``(N,)`` or ``(N, A)``."""
        return self.act_with_memory(observations, [None] * len(observations), None)[0]

    def act_with_memory(
        self, observations: Array, memories: Memories, envs: Sequence[Any] | None
    ) -> tuple[Array, Memories]:
        """See ``ibe_rl.envs.acting.PolicyWithMemory``.

        Raises:
            ConfigError: if the agent returns actions outside the action space.
        """
        chosen, memories = self.agent(observations[:, : self.seen].copy(), memories, envs)  # it may write into them
        actions = shaped(plain_array(chosen), self.actions)
        if not fits(actions, self.actions, len(observations)):
            raise ConfigError(
                f"agent: for {len(observations)} observations it returned {actions.dtype} of shape {actions.shape} "
                f"({str(actions.ravel()[:4])[:80]} …); allowed is one action of {self.actions} each"
            )
        if isinstance(self.actions, Box):
            return self._within(actions), memories
        return actions.astype(np.int64), memories

    def _within(self, actions: Array) -> Array:
        inside = bounded(actions, self.actions)
        outside = actions != inside
        if outside.any():
            self.clipped.append(float(actions[outside][0]))
        return inside.astype(np.float32)


def as_policy(
    agent: Any,
    task: Task,
    actions: gymnasium.Space[Any],
    reading: Reading,
    examples: Array,
    envs: Sequence[Any] | None = None,
) -> ExternalPolicy:
    """Wrap an agent as a policy and test it on ``examples``.

    Args:
        agent: a model of stable-baselines3, a policy module of TorchRL, or a function from observations ``(N, ·)`` or
            a single one ``(·,)`` to actions.
        task: the environment's task.
        actions: the environment's action space.
        reading: what it reads.
        examples: observations ``(N, O)`` to test it with, at least five.
        envs: ``N`` environments, which have masks if the agent reads them.

    Raises:
        ConfigError: if it does not fit the environment or its observation size is unknown; both sizes are named.
    """
    check_action_space(actions)
    space = _own_space(agent, reading, envs)
    seen = _seen(agent, task, reading) if space is None else task.percept_size
    check_same_actions("agent", agent, actions)
    tried = np.tile(examples[:, :seen], (1, reading.frames))
    called = _adapted(agent, actions, tried)
    called = _behind(called, reading, seen) if space is None else of_parts(called, reading, space)
    policy = ExternalPolicy(called, seen, actions)
    try:
        first = policy.act_with_memory(examples, [None] * len(examples), envs)[0]
        again = policy.act_with_memory(examples, [None] * len(examples), envs)[0]
    except ConfigError:
        raise
    except Exception as error:  # external code may raise anything
        raise ConfigError(
            f"agent: it fails on an observation of {tried.shape[1]} numbers ({raised(error)}); {_sizes(task)}"
        ) from None
    policy.clipped.clear()
    if not np.array_equal(first, again):
        policy.notes.append(_CHANCE)
    return policy


def _behind(agent: Adapter, reading: Reading, seen: int) -> Adapter:
    """Put the frames and the statistics before the agent, in the order in which the statistics were taken."""
    stacked = Stacked(agent, reading.frames) if reading.frames > 1 else agent
    if reading.statistics is None:
        return stacked
    if isinstance(reading.statistics, KeyStatistics):
        raise ConfigError(
            f"agent_vec_normalize: its statistics are of the keys {', '.join(reading.statistics.by_key)}; allowed is "
            f"({seen},), as the agent reads them"
        )
    sizes = reading.statistics.mean.shape
    if sizes == (seen,):
        return Normalised(stacked, reading.statistics)
    if sizes == (seen * reading.frames,):
        return Stacked(Normalised(agent, reading.statistics), reading.frames)
    raise ConfigError(
        f"agent_vec_normalize: its statistics are of observations of shape {sizes}; allowed is ({seen},), as the agent "
        "reads them"
    )


def _own_space(agent: Any, reading: Reading, envs: Sequence[Any] | None) -> gymnasium.Space[Any] | None:
    """The environment's observation space, for an agent that reads its observations; None for one that reads rows."""
    declared = getattr(agent, "observation_space", None)
    rows = declared is None or (isinstance(declared, Box) and len(declared.shape) == 1)
    if rows or not envs or not envs[0].has_wrapper_attr("sense"):
        return None
    space: gymnasium.Space[Any] = envs[0].get_wrapper_attr("sense").space
    if type(declared) is not type(space) or flatdim(declared) != flatdim(space):
        raise ConfigError(
            f"agent: it reads observations {declared!s:.200}; allowed are the environment's, {space!s:.200}"
        )
    if reading.frames > 1:
        raise ConfigError(
            f"agent_frame_stack: its observations are {space!s:.200}; allowed is null, or observations in a row"
        )
    return space


def _sizes(task: Task) -> str:
    what = "the observation as one row" if task.parts else "the state"
    return (
        f"allowed is one that reads {what}, {task.percept_size} numbers, or with the instruction and whether "
        f"it was given {task.observation_size}"
    )


def _seen(agent: Any, task: Task, reading: Reading) -> int:
    """How many numbers of an observation the agent reads."""
    state, whole_size = task.percept_size, task.observation_size
    declared, asked = getattr(agent, "observation_space", None), reading.sees_instruction
    if declared is None:
        if asked is None:
            raise ConfigError(
                f"agent_sees_instruction=null: this agent does not declare what it reads; allowed is true for "
                f"{whole_size} numbers (state, instruction, whether it was given) or false for the state, {state}"
            )
        return whole_size if asked else state
    if not isinstance(declared, Box):
        raise ConfigError(f"agent: it reads observations {declared!s:.200}; {_sizes(task)}")
    if declared.shape not in ((state * reading.frames,), (whole_size * reading.frames,)):
        raise ConfigError(
            f"agent: it reads observations of shape {declared.shape}; {_sizes(task)}"
            f"{_stacked(declared.shape, state, whole_size)}"
        )
    sees = declared.shape == (whole_size * reading.frames,)
    if asked not in (None, sees):
        raise ConfigError(
            f"agent_sees_instruction={str(asked).lower()}: the agent says that it reads "
            f"{declared.shape[0]} numbers; allowed is {str(sees).lower()}, or none"
        )
    return whole_size if sees else state


def _stacked(shape: tuple[int, ...], *sizes: int) -> str:
    """What to set if the shape is that of several observations."""
    for size in sizes:
        if len(shape) == 1 and shape[0] % size == 0:
            return f"; agent_frame_stack={shape[0] // size} if it was trained behind VecFrameStack"
    return ""


def _adapted(agent: Any, actions: gymnasium.Space[Any], tried: Array) -> Adapter:
    if isinstance(agent, TensorDictModuleBase):
        first = int(actions.start) if isinstance(actions, Discrete) else None
        return ReadsTensorDicts.of(deepcopy(agent).cpu().eval(), first)
    if hasattr(agent, "predict"):
        policy = getattr(agent, "policy", agent)
        module = {part.__module__.rpartition(".")[0] for part in type(policy).__mro__}
        if "sb3_contrib.common.maskable" in module:
            return PredictsMasked(policy)
        return PredictsRecurrently(policy) if hasattr(policy, "lstm_actor") else Predicts(policy)
    if isinstance(agent, torch.nn.Module):
        raise ConfigError(
            f"agent: {type(agent).__name__} is a network, which says nothing about actions; allowed is a function from "
            "observations to actions that calls it (docs/OWN_AGENT.md)"
        )
    if callable(agent):
        return Batched(agent) if _is_batched(agent, actions, tried) else OneByOne(agent)
    raise ConfigError(f"agent={agent!r:.80}: allowed is a model of stable-baselines3, a TorchRL policy, or a function")


def _is_batched(function: Callable[[Array], Any], actions: gymnasium.Space[Any], tried: Array) -> bool:
    """Whether a function answers a batch as it answers each observation of it.

    Tried with two sizes, neither the number of numbers in an observation: one observation is no batch of numbers then.
    """
    sizes = [size for size in range(len(tried), 1, -1) if size != tried.shape[1]][:2]
    try:
        several = [shaped(plain_array(function(tried[:size].copy())), actions) for size in sizes]
        if not all(fits(one, actions, size) for one, size in zip(several, sizes, strict=True)):
            return False
    except Exception:  # a function of one observation may raise anything on a batch
        return False
    try:
        single = np.stack([plain_array(function(row)) for row in tried[: sizes[0]].copy()])
    except Exception:  # and a function of a batch on a single one
        return True
    alone = shaped(single, actions)
    if not fits(alone, actions, sizes[0]) or np.allclose(alone, several[0], atol=1e-4):
        return True
    again = shaped(plain_array(function(tried[: sizes[0]].copy())), actions)
    return not np.array_equal(again, several[0])  # by chance they differ anyway


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
        return self.act_with_memory(observations, [None] * len(observations), None)[0]

    def act_with_memory(
        self, observations: Array, memories: Memories, envs: Sequence[Any] | None
    ) -> tuple[Array, Memories]:
        """See ``ibe_rl.envs.acting.PolicyWithMemory``; random actions are such as the masks allow."""
        acting = Acting(self._policy, memories)
        chosen = acting(observations, range(len(observations)), envs)
        for row in np.flatnonzero(self._random.random(len(chosen)) < self._share).tolist():
            chosen[row] = sampled_action(self._actions, None if envs is None else envs[row])
        return chosen, acting.memories
