"""Reactions of an agent to opposite instructions in the same state, which show what the words mean to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.collect.rollout import moments_at
from ibe_rl.envs.acting import Acting
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.types import Array, Instructor, Moment, Policy, Predictor, columns_of, observe, percepts_of

ASKED_AT = 24
"""Moments, each from a different episode."""


def ask(moments: Sequence[Moment], policy: Policy, predictor: Predictor, horizon_steps: int) -> Reactions | None:
    """Roll the policy out from the same moments, instructed +1 throughout and -1 throughout.

    Args:
        moments: ``M`` moments of different episodes.
        policy: the greedy policy.
        predictor: predicts the rollouts.
        horizon_steps: n.

    Returns:
        The changes of the state, 0 if the instruction changes no action at any of the moments; None without moments.
    """
    if not moments:
        return None
    size = len(moments[0].instruction)
    instructions = [sign * np.eye(size, dtype=np.float32)[number] for sign in (1, -1) for number in range(size)]
    if not _listens(moments, policy, instructions):
        nothing = np.zeros((len(moments), size, len(moments[0].state)))
        return Reactions(nothing, nothing)
    changes = [_changes(moments, policy, predictor, horizon_steps, one) for one in instructions]
    up, down = np.stack(changes[:size], axis=1), np.stack(changes[size:], axis=1)
    return Reactions(up, down)


def ask_during_rollouts(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    predictor: Predictor,
    seeds: Sequence[int],
    typical_steps: int,
    horizon_steps: int,
) -> Reactions | None:
    """As ``ask``, at moments drawn from new episodes, one per episode.

    Args:
        envs: environments of one kind, at most one per episode; they are reset.
        policy: the greedy policy.
        instructor: is reset.
        predictor: predicts the rollouts.
        seeds: of the episodes and of the draw.
        typical_steps: episode length within which moments are drawn.
        horizon_steps: n.
    """
    steps = np.random.default_rng(list(seeds)).integers(max(1, typical_steps), size=len(seeds)).tolist()
    return ask(moments_at(envs, policy, instructor, seeds, steps), policy, predictor, horizon_steps)


@dataclass(frozen=True)
class ActsUnder:
    """A policy with one instruction ``(d,)`` put into all its observations; see ``PolicyWithMemory``."""

    policy: Policy
    instruction: Array

    def __call__(self, observations: Array) -> Array:
        """Actions at observations ``(N, O)``."""
        return self.policy(self._under(observations))

    def act_with_memory(
        self, observations: Array, memories: Sequence[Any], envs: Sequence[Any] | None
    ) -> tuple[Array, Sequence[Any]]:
        """See ``ibe_rl.envs.acting.PolicyWithMemory``."""
        acting = Acting(self.policy, memories)
        actions = acting(self._under(observations), range(len(observations)), envs)
        return actions, acting.memories

    def _under(self, observations: Array) -> Array:
        percepts = observations[:, : -len(self.instruction) - 1]
        count = len(percepts)
        return observe(percepts, np.tile(self.instruction, (count, 1)), np.ones((count, 1)))


def _listens(moments: Sequence[Moment], policy: Policy, instructions: Sequence[Array]) -> bool:
    observations = observe(percepts_of(moments), *columns_of(moments)[1:])
    memories = [moment.memory for moment in moments]
    rows = range(len(moments))
    first, *others = (Acting(ActsUnder(policy, one), memories)(observations, rows, None) for one in instructions)
    return any(not np.array_equal(first, other) for other in others)


def _changes(
    moments: Sequence[Moment], policy: Policy, predictor: Predictor, horizon_steps: int, instruction: Array
) -> Array:
    asked = [replace(moment, instruction=instruction, given=True) for moment in moments]
    paths = predictor.rollout(asked, ActsUnder(policy, instruction), horizon_steps).paths
    return paths[:, -1] - paths[:, 0]
