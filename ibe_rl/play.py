"""Fly whole episodes with the greedy policy: to be counted, or to be watched and explained."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.data import Array, Episode, Instructor, Moment, Policy, Shape, Watched, observe
from ibe_rl.env.make import task_of


class _Flight:
    """One environment in the middle of an episode, and what happened so far."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int, context: str | None):
        self.env, self.task = env, task_of(env)
        state, _ = env.reset(seed=seed, options={self.task.context_option: context} if context else None)
        self.states: list[Array] = [state]
        self.actions: list[Any] = []
        self.rewards: list[float] = []
        self.instructions: list[Array] = []
        self.given: list[bool] = []
        self.done = self.terminated = self.success = False

    def step(self, action: Any, instruction: Array, given: bool) -> None:
        state, reward, self.terminated, truncated, info = self.env.step(action)
        self.done = self.terminated or truncated
        self.success = bool(info[self.task.success_key])
        self.states.append(state)
        self.actions.append(action)
        self.rewards.append(float(reward))
        self.instructions.append(instruction)
        self.given.append(given)

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
    episodes: list[Episode] = []
    for first in range(0, len(seeds), len(envs)):
        together = seeds[first : first + len(envs)]
        flights = [_Flight(env, seed, None) for env, seed in zip(envs, together, strict=False)]
        instructor.reset(np.ones(len(flights), bool))
        while any(not flight.done for flight in flights):
            _step_all(flights, policy, instructor)
        episodes += [flight.episode() for flight in flights]
    return episodes


def _step_all(flights: Sequence[_Flight], policy: Policy, instructor: Instructor) -> None:
    """Step those that are not done; the instructor sees all rows, so that each keeps its place."""
    states = np.array([flight.states[-1] for flight in flights])
    instruction, given = instructor.instruct(states)
    rows = [row for row, flight in enumerate(flights) if not flight.done]
    actions = policy(observe(states[rows], instruction[rows], given[rows]))
    for row, action in zip(rows, actions, strict=True):
        flights[row].step(action, instruction[row], bool(given[row, 0]))


def watch(
    env: gymnasium.Env[Any, Any], policy: Policy, instructor: Instructor, seed: int, context: str | None = None
) -> Watched:
    """Fly one episode and keep all that is needed to draw and to explain it.

    Args:
        env: an environment with ``snapshot``; with ``background`` and ``figure`` it can be drawn.
        policy: the greedy policy.
        instructor: begins anew.
        seed: of the episode.
        context: one of the task's contexts; None draws one.
    """
    flight = _Flight(env, seed, context)
    game: Any = env.unwrapped  # with a snapshot, which gymnasium's own type does not know
    instructor.reset(np.ones(1, bool))
    moments: list[Moment] = []
    figures = [_drawn(game, "figure")]
    background = _drawn(game, "background")
    while not flight.done:
        state = flight.states[-1]
        instruction, given = instructor.instruct(state[None])
        moments.append(Moment(state, instruction[0], bool(given[0, 0]), game.snapshot()))
        action = policy(observe(state[None], instruction, given))[0]
        flight.step(action, instruction[0], moments[-1].given)
        figures.append(_drawn(game, "figure"))
    return Watched(flight.episode(), moments, background, figures)


def _drawn(game: Any, part: str) -> list[Shape]:
    draw = getattr(game, part, None)
    return draw() if draw else []
