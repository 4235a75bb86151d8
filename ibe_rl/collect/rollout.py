"""Rolls out whole episodes with the greedy policy, for evaluation, recording and explanation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.envs.acting import Acting
from ibe_rl.envs.errors import GateError, located
from ibe_rl.envs.instructed_envs import TRAINING_SEEDS, step_together
from ibe_rl.envs.snapshots import Stoppable, stoppable
from ibe_rl.envs.wrappers import drawn, task_of
from ibe_rl.task import PERCEPT, RecordedRollout
from ibe_rl.types import Array, Episode, Instructor, Moment, Policy, observe

EVALUATION_SEED = TRAINING_SEEDS
"""First seed of the evaluations of ``train.py``; training uses none of these seeds."""
JUDGING_SEED = 2_050_000_000
"""First seed of the episodes on which ``explain.py`` judges; training and evaluation use none of these."""


class _Rollout:
    """One environment within an episode, and its history; ``keep`` includes the moments."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int, context: str | None = None, keep: bool = False):
        self.env, self.task = env, task_of(env)
        self.keep = False
        self._game: Stoppable | None = None
        if keep:
            self.keep_moments()
        state, info = env.reset(seed=seed, options={self.task.context_option: context} if context else None)
        self.states: list[Array] = [state]
        self.percepts: list[Array] = [info.get(PERCEPT, state)]
        self.actions: list[Any] = []
        self.rewards: list[float] = []
        self.instructions: list[Array] = []
        self.given: list[bool] = []
        self.moments: list[Moment] = []
        self.done = self.terminated = self.success = False

    def keep_moments(self) -> None:
        self.keep, self._game = True, stoppable(self.env)

    def hear(self, instruction: Array, given: bool, memory: Any) -> None:
        if self.keep:
            snapshot = self._game.snapshot() if self._game else None
            percept = self.percepts[-1] if self.task.parts else None
            self.moments.append(Moment(self.states[-1], instruction, given, snapshot, percept, memory))
        self.instructions.append(instruction)
        self.given.append(given)

    def add(self, action: Any, state: Array, reward: float, terminated: bool, truncated: bool, info: Any) -> None:
        self.terminated, self.done = terminated, terminated or truncated
        self.success = info[self.task.success_key]
        self.states.append(state)
        self.percepts.append(info.get(PERCEPT, state))
        self.actions.append(action)
        self.rewards.append(float(reward))

    def episode(self) -> Episode:
        return Episode(
            states=np.array(self.states),
            actions=np.array(self.actions),
            rewards=np.array(self.rewards, np.float32),
            instructions=np.array(self.instructions),
            given=np.array(self.given),
            terminated=self.terminated,
            success=self.success,
            context=self.task.context(self.states[0]),
            percepts=np.array(self.percepts) if self.task.parts else None,
        )


def play(
    envs: Sequence[gymnasium.Env[Any, Any]], policy: Policy, instructor: Instructor, seeds: Sequence[int]
) -> list[Episode]:
    """Roll out one whole episode per seed, as many at once as there are environments.

    Args:
        envs: environments of one kind; they are reset.
        policy: the greedy policy.
        instructor: is reset for each episode.
        seeds: one per episode.

    Returns:
        The episodes in the order of ``seeds``; the sample is not biased towards short ones.
    """
    return [rollout.episode() for rollout in _rollouts(envs, policy, instructor, seeds)]


def rollouts_with_moments(
    envs: Sequence[gymnasium.Env[Any, Any]], policy: Policy, instructor: Instructor, seeds: Sequence[int]
) -> Iterator[tuple[Episode, Sequence[Moment]]]:
    """As ``play``, yielding each episode with the ``T`` moments before its actions.

    Moments take much memory: keep only those that are needed.
    """
    for rollout in _rollouts(envs, policy, instructor, seeds, keep=True):
        yield rollout.episode(), rollout.moments


def moments_at(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    steps: Sequence[int],
) -> list[Moment]:
    """Roll out one episode per seed up to a step and keep that moment; episodes that end before have none.

    Args:
        envs: environments of one kind, one per episode; they are reset.
        policy: the greedy policy.
        instructor: is reset.
        seeds: one per episode.
        steps: when to take the moment, one per episode.
    """
    rollouts = [_Rollout(env, seed) for env, seed in zip(envs, seeds, strict=False)]
    instructor.reset(np.ones(len(rollouts), bool))
    acting = Acting(policy, [None] * len(rollouts))
    for step in range(max(steps, default=-1) + 1):
        here = [rollout for rollout, last in zip(rollouts, steps, strict=False) if last == step and not rollout.done]
        for rollout in here:
            rollout.keep_moments()
        if any(not rollout.done for rollout in rollouts):
            _step_all(rollouts, acting, instructor)
        for rollout in here:
            rollout.done = True
    return [moment for rollout in rollouts for moment in rollout.moments]


def _rollouts(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    keep: bool = False,
) -> Iterator[_Rollout]:
    for first in range(0, len(seeds), len(envs)):
        together = seeds[first : first + len(envs)]
        rollouts = [_Rollout(env, seed, keep=keep) for env, seed in zip(envs, together, strict=False)]
        instructor.reset(np.ones(len(rollouts), bool))
        acting = Acting(policy, [None] * len(rollouts))
        while any(not rollout.done for rollout in rollouts):
            _step_all(rollouts, acting, instructor)
        yield from rollouts


def _step_all(rollouts: Sequence[_Rollout], acting: Acting, instructor: Instructor) -> None:
    """Step the unfinished rollouts; the instructor sees all rows, so that each keeps its index."""
    states = np.array([rollout.states[-1] for rollout in rollouts])
    unfinished = np.array([not rollout.done for rollout in rollouts])
    try:
        instruction, given = instructor.instruct(states, unfinished)
    except GateError as error:
        raise located(error, [rollout.env for rollout in rollouts], states) from None
    rows = np.flatnonzero(unfinished).tolist()
    before, envs = [acting.memories[row] for row in rows], [rollout.env for rollout in rollouts]
    percepts = np.array([rollouts[row].percepts[-1] for row in rows])
    actions = acting(observe(percepts, instruction[rows], given[rows]), rows, envs)
    for row, memory in zip(rows, before, strict=True):
        rollouts[row].hear(instruction[row], bool(given[row, 0]), memory)
    steps = step_together([rollouts[row].env for row in rows], actions)
    for row, *step in zip(rows, actions, *steps, strict=True):
        rollouts[row].add(*step)


def record_rollout(
    env: gymnasium.Env[Any, Any], policy: Policy, instructor: Instructor, seed: int, context: str | None = None
) -> RecordedRollout:
    """Roll out one episode and keep all that is needed to draw and explain it.

    Args:
        env: can be drawn if it has ``background`` and ``figure``.
        policy: the greedy policy.
        instructor: is reset.
        seed: of the episode.
        context: one of the task's contexts; None draws one.
    """
    rollout = _Rollout(env, seed, context, keep=True)
    instructor.reset(np.ones(1, bool))
    figures = [drawn(env, "figure")]
    background = drawn(env, "background")
    acting = Acting(policy, [None])
    while not rollout.done:
        _step_all([rollout], acting, instructor)
        figures.append(drawn(env, "figure"))
    return RecordedRollout(rollout.episode(), rollout.moments, background, figures)
