"""The moments that explanations are judged at: unseen greedy episodes, and sampled futures from each moment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.collect.rollout import play_moments
from ibe_rl.evaluation.progress_bar import waiting
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode, Instructor, Moment, Policy, Predictor

AT_ONCE = 100
"""Episodes flown side by side."""
PER_ROLLOUT = 640
"""Futures predicted between two steps of the progress bar."""
SEEN_STEPS = 20
"""Steps that an observer sees before it has to foretell (the paper's prediction task)."""


@dataclass(frozen=True)
class Moments:
    """``N`` moments of greedy episodes, what followed, and ``F`` sampled futures of each, over ``H`` horizons.

    Attributes:
        episode: ``(N,)`` number of the episode, from 0.
        seed: ``(N,)`` of the episode.
        step: ``(N,)`` step of the episode.
        state: ``(N, S)``.
        instruction: ``(N, d)``, 0 in silence.
        given: ``(N,)`` bool, False where the instructor said nothing.
        regular: ``(N,)`` bool, on the stride; the others are there for the observer only.
        observed: ``(N,)`` bool, as many steps before the first contact as the observer foretells.
        realised: ``(N, H, S)`` change of the state over each horizon; past the end of the episode it ends there.
        predicted: ``(N, F, H, S)`` the same in each of the futures.
        trusted: ``(N, F, H)`` bool, whether the predictor stands by them.
        horizons_steps: the ``H`` horizons, rising.
    """

    episode: Array
    seed: Array
    step: Array
    state: Array
    instruction: Array
    given: Array
    regular: Array
    observed: Array
    realised: Array
    predicted: Array
    trusted: Array
    horizons_steps: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.step)

    def __getitem__(self, rows: Array) -> Moments:
        """Some of the moments."""
        columns = {item.name: getattr(self, item.name)[rows] for item in fields(self)[:-1]}
        return Moments(**columns, horizons_steps=self.horizons_steps)

    def judged(self) -> Moments:
        """The moments on the stride at which there was an instruction."""
        return self[self.regular & self.given]

    def first_future(self) -> Moments:
        """The same with one future only."""
        return replace(self, predicted=self.predicted[:, :1], trusted=self.trusted[:, :1])

    def at(self, horizon_steps: int) -> int:
        """Where a horizon stands in ``realised`` and ``predicted``."""
        return self.horizons_steps.index(horizon_steps)


@dataclass(frozen=True)
class Plan:
    """Which moments are taken of an episode, and how far ahead is looked.

    Attributes:
        stride_steps: from one moment to the next.
        futures: sampled from each.
        horizons_steps: rising; the longest one is rolled out, the others are the beginnings of the same paths.
        observer_steps: how long before the first contact the observer foretells; None without observer.
    """

    stride_steps: int
    futures: int
    horizons_steps: tuple[int, ...]
    observer_steps: int | None = None


@dataclass(frozen=True)
class Taken:
    """A moment with what is known of it once the episode is over."""

    moment: Moment
    episode: int
    seed: int
    step: int
    regular: bool
    observed: bool
    realised: Array


def gather(
    make_env: Callable[[], gymnasium.Env[Any, Any]],
    task: Task,
    policy: Policy,
    instructor: Instructor,
    predictor: Predictor,
    seeds: Sequence[int],
    plan: Plan,
    title: str = "futures",
) -> Moments:
    """Fly an episode for each seed, then roll out the futures of its moments, with a progress bar.

    Args:
        make_env: makes one environment with ``snapshot``.
        task: the environment's own.
        policy: the greedy policy.
        instructor: begins anew with each episode.
        predictor: draws its own noise for each roll-out.
        seeds: of episodes that the policy was not trained on.
        plan: which moments.
        title: of the progress bar.
    """
    taken = fly_moments(make_env, task, policy, instructor, seeds, plan)
    return put_together(taken, *predict_all(taken, policy, predictor, plan, title), plan)


def fly_moments(
    make_env: Callable[[], gymnasium.Env[Any, Any]],
    task: Task,
    policy: Policy,
    instructor: Instructor,
    seeds: Sequence[int],
    plan: Plan,
) -> list[Taken]:
    """Fly an episode for each seed and keep the moments that the plan asks for; see ``gather``."""
    envs = [make_env() for _ in range(min(len(seeds), AT_ONCE))]
    taken: list[Taken] = []
    for number, (episode, moments) in enumerate(play_moments(envs, policy, instructor, seeds)):
        taken += _take(episode, moments, number, seeds[number], plan, task)
    return taken


def put_together(taken: Sequence[Taken], predicted: Array, trusted: Array, plan: Plan) -> Moments:
    """Moments with what was predicted of them, from ``predict_all``."""
    of_each = ("episode", "seed", "step", "regular", "observed", "realised")
    columns = {name: np.array([getattr(one, name) for one in taken]) for name in of_each}
    return Moments(
        state=np.array([one.moment.state for one in taken]),
        instruction=np.array([one.moment.instruction for one in taken]),
        given=np.array([one.moment.given for one in taken]),
        predicted=predicted,
        trusted=trusted,
        horizons_steps=plan.horizons_steps,
        **columns,
    )


def _take(episode: Episode, moments: Sequence[Moment], number: int, seed: int, plan: Plan, task: Task) -> list[Taken]:
    """The moments of one episode that the plan asks for."""
    observed = _observed_step(episode, plan, task)
    regular = range(0, len(episode), plan.stride_steps)
    ahead = np.array(plan.horizons_steps)
    return [
        Taken(
            moment=moments[step],
            episode=number,
            seed=seed,
            step=step,
            regular=step in regular,
            observed=step == observed,
            realised=episode.states[np.minimum(step + ahead, len(episode))] - episode.states[step],
        )
        for step in sorted({*regular, *([] if observed is None else [observed])})
    ]


def _observed_step(episode: Episode, plan: Plan, task: Task) -> int | None:
    """The step at which the observer foretells; None where there is no contact, or one too early to have seen much."""
    if plan.observer_steps is None or task.first_contact is None:
        return None
    contact = task.first_contact(episode.states)
    if contact < SEEN_STEPS + plan.observer_steps:
        return None
    return contact - plan.observer_steps


def predict_all(
    taken: Sequence[Taken], policy: Policy, predictor: Predictor, plan: Plan, title: str
) -> tuple[Array, Array]:
    """Changes ``(N, F, H, S)`` in the futures of the moments, and whether they are trusted ``(N, F, H)``."""
    futures = [one.moment for one in taken for _ in range(plan.futures)]
    cuts, ahead = range(0, len(futures), PER_ROLLOUT), np.array(plan.horizons_steps)
    parts, trusted = [], []
    with waiting(title, len(cuts)) as step:
        for cut in cuts:
            predicted = predictor.rollout(futures[cut : cut + PER_ROLLOUT], policy, plan.horizons_steps[-1])
            parts.append(predicted.paths[:, ahead] - predicted.paths[:, :1])
            trusted.append(predicted.trusted_steps[:, None] >= ahead)
            step()
    together = np.concatenate(parts)
    shape = (len(taken), plan.futures, len(ahead))
    return together.reshape(*shape, -1), np.concatenate(trusted).reshape(shape)
