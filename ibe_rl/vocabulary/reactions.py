"""What an agent does if it is told otherwise in the same state: its influence shows what it takes the words for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.collect.rollout import moments_at
from ibe_rl.ibe.meaning import Reactions
from ibe_rl.types import Array, Instructor, Moment, Policy, Predictor, columns_of, observe

ASKED_AT = 24
"""Moments, each of an episode of its own."""


def ask(moments: Sequence[Moment], policy: Policy, predictor: Predictor, horizon_steps: int) -> Reactions | None:
    """Roll the policy out from the same moments, told +1 all the time and told -1.

    Args:
        moments: ``M`` moments of different episodes.
        policy: the greedy policy.
        predictor: where it leads.
        horizon_steps: n.

    Returns:
        The changes of the state; they are 0 if the policy acts alike at all these moments whatever it is told. None
        without any moment.
    """
    if not moments:
        return None
    size = len(moments[0].instruction)
    told = [sign * np.eye(size, dtype=np.float32)[number] for sign in (1, -1) for number in range(size)]
    if not _listens(moments, policy, told):
        nothing = np.zeros((len(moments), size, len(moments[0].state)))
        return Reactions(nothing, nothing)
    changes = [_changes(moments, policy, predictor, horizon_steps, one) for one in told]
    up, down = np.stack(changes[:size], axis=1), np.stack(changes[size:], axis=1)
    return Reactions(up, down)


def ask_in_flight(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    predictor: Predictor,
    seeds: Sequence[int],
    typical_steps: int,
    horizon_steps: int,
) -> Reactions | None:
    """As ``ask``, at moments drawn from episodes of its own, one an episode.

    Args:
        envs: environments of one kind, at most one an episode; they are reset.
        policy: the greedy policy.
        instructor: begins anew.
        predictor: where the policy leads.
        seeds: of the episodes, and of the draw.
        typical_steps: length of an episode, within which the moments lie.
        horizon_steps: n.
    """
    steps = np.random.default_rng(list(seeds)).integers(max(1, typical_steps), size=len(seeds)).tolist()
    return ask(moments_at(envs, policy, instructor, seeds, steps), policy, predictor, horizon_steps)


def told_throughout(policy: Policy, instruction: Array, observations: Array) -> Array:
    """What the policy does at observations ``(N, O)`` if the instruction ``(d,)`` stands in all of them."""
    states = observations[:, : -len(instruction) - 1]
    count = len(states)
    return policy(observe(states, np.tile(instruction, (count, 1)), np.ones((count, 1))))


def _listens(moments: Sequence[Moment], policy: Policy, told: Sequence[Array]) -> bool:
    observations = observe(*columns_of(moments))
    first, *others = (told_throughout(policy, one, observations) for one in told)
    return any(not np.array_equal(first, other) for other in others)


def _changes(
    moments: Sequence[Moment], policy: Policy, predictor: Predictor, horizon_steps: int, instruction: Array
) -> Array:
    asked = [replace(moment, instruction=instruction, given=True) for moment in moments]
    paths = predictor.rollout(asked, partial(told_throughout, policy, instruction), horizon_steps).paths
    return paths[:, -1] - paths[:, 0]
