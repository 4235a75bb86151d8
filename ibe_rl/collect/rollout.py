"""Fly whole episodes with the greedy policy: to be counted, or to be watched and explained."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.envs.make import TRAINING_SEEDS, drawn, step_together, task_of
from ibe_rl.envs.snapshots import Stoppable, stoppable
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Array, Episode, Instructor, Moment, Policy, observe

EVALUATION_SEED = TRAINING_SEEDS
"""Seeds that no training uses, for the evaluations of ``train.py``."""
JUDGING_SEED = 2_050_000_000
"""Seeds that neither uses, for ``explain.py`` to judge explanations on."""


class _Rollout:
    """One environment in the middle of an episode, and what happened so far; ``keep`` the moments too."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int, context: str | None = None, keep: bool = False):
        self.env, self.task = env, task_of(env)
        self.keep = False
        self._game: Stoppable | None = None
        if keep:
            self.keep_moments()
        state, _ = env.reset(seed=seed, options={self.task.context_option: context} if context else None)
        self.states: list[Array] = [state]
        self.actions: list[Any] = []
        self.rewards: list[float] = []
        self.instructions: list[Array] = []
        self.given: list[bool] = []
        self.moments: list[Moment] = []
        self.done = self.terminated = self.success = False

    def keep_moments(self) -> None:
        self.keep, self._game = True, stoppable(self.env)

    def hear(self, instruction: Array, given: bool) -> None:
        if self.keep:
            snapshot = self._game.snapshot() if self._game else None
            self.moments.append(Moment(self.states[-1], instruction, given, snapshot))
        self.instructions.append(instruction)
        self.given.append(given)

    def add(self, action: Any, state: Array, reward: float, terminated: bool, truncated: bool, info: Any) -> None:
        self.terminated, self.done = terminated, terminated or truncated
        self.success = bool(info[self.task.success_key])
        self.states.append(state)
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
        )


def play(
    envs: Sequence[gymnasium.Env[Any, Any]], policy: Policy, instructor: Instructor, seeds: Sequence[int]
) -> list[Episode]:
    """Fly one whole episode for each seed, as many at once as there are environments.

    Args:
        envs: environments of one kind; they are reset.
        policy: the greedy policy.
        instructor: begins anew with each episode.
        seeds: one an episode.

    Returns:
        The episodes in the order of ``seeds``; short ones are not favoured.
    """
    return [flight.episode() for flight in _fly(envs, policy, instructor, seeds)]


def rollouts_with_moments(
    envs: Sequence[gymnasium.Env[Any, Any]], policy: Policy, instructor: Instructor, seeds: Sequence[int]
) -> Iterator[tuple[Episode, Sequence[Moment]]]:
    """As ``play``, one episode after the other with the ``T`` moments before its actions.

    Moments are many: keep those that are needed, and the others are forgotten.
    """
    for flight in _fly(envs, policy, instructor, seeds, keep=True):
        yield flight.episode(), flight.moments


def moments_at(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    steps: Sequence[int],
) -> list[Moment]:
    """Fly one episode for each seed up to a step, and keep that moment; episodes that are over by then have none.

    Args:
        envs: environments of one kind, one an episode; they are reset.
        policy: the greedy policy.
        instructor: begins anew.
        seeds: one an episode.
        steps: one an episode, at which the moment is taken.
    """
    flights = [_Rollout(env, seed) for env, seed in zip(envs, seeds, strict=False)]
    instructor.reset(np.ones(len(flights), bool))
    for step in range(max(steps, default=-1) + 1):
        here = [flight for flight, last in zip(flights, steps, strict=False) if last == step and not flight.done]
        for flight in here:
            flight.keep_moments()
        if any(not flight.done for flight in flights):
            _step_all(flights, policy, instructor)
        for flight in here:
            flight.done = True
    return [moment for flight in flights for moment in flight.moments]


def _fly(
    envs: Sequence[gymnasium.Env[Any, Any]],
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    keep: bool = False,
) -> Iterator[_Rollout]:
    for first in range(0, len(seeds), len(envs)):
        together = seeds[first : first + len(envs)]
        flights = [_Rollout(env, seed, keep=keep) for env, seed in zip(envs, together, strict=False)]
        instructor.reset(np.ones(len(flights), bool))
        while any(not flight.done for flight in flights):
            _step_all(flights, policy, instructor)
        yield from flights


def _step_all(flights: Sequence[_Rollout], policy: Policy, instructor: Instructor) -> None:
    """Step those that are not done; the instructor sees all rows, so that each keeps its place."""
    states = np.array([flight.states[-1] for flight in flights])
    flying = np.array([not flight.done for flight in flights])
    instruction, given = instructor.instruct(states, flying)
    rows = np.flatnonzero(flying).tolist()
    actions = policy(observe(states[rows], instruction[rows], given[rows]))
    for row in rows:
        flights[row].hear(instruction[row], bool(given[row, 0]))
    steps = step_together([flights[row].env for row in rows], actions)
    for row, *step in zip(rows, actions, *steps, strict=True):
        flights[row].add(*step)


def record_rollout(
    env: gymnasium.Env[Any, Any], policy: Policy, instructor: Instructor, seed: int, context: str | None = None
) -> RecordedRollout:
    """Fly one episode and keep all that is needed to draw and to explain it.

    Args:
        env: an environment; with ``background`` and ``figure`` it can be drawn.
        policy: the greedy policy.
        instructor: begins anew.
        seed: of the episode.
        context: one of the task's contexts; None draws one.
    """
    flight = _Rollout(env, seed, context, keep=True)
    instructor.reset(np.ones(1, bool))
    figures = [drawn(env, "figure")]
    background = drawn(env, "background")
    while not flight.done:
        _step_all([flight], policy, instructor)
        figures.append(drawn(env, "figure"))
    return RecordedRollout(flight.episode(), flight.moments, background, figures)
