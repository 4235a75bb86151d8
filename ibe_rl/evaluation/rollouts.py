"""Held-out greedy episodes, the moments that explanations are evaluated at, and sampled futures of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ibe_rl.collect.rollout import JUDGING_SEED, rollouts_with_moments
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig
from ibe_rl.evaluation.moments import FUTURES_AT_ONCE, SEEN_STEPS, Moments, Plan, TakenMoment
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Episode, Moment, Policy, Predictor

SEEDS_EACH = 10_000
"""Seeds for each purpose and ``evaluate.seed``; ``evaluate.seed`` has 1,000 values."""
PURPOSES = ("judged", "held_out", "changing", "screened", "flown", "checked", "foretold", "summed")
EPISODES_AT_ONCE = 100
HORIZONS_STEPS = (20, 40, 60, 100)
"""Judged where none are set."""


def seeds_for(purpose: str, seed: int, episodes: int) -> range:
    """Seeds of episodes, disjoint from training and all other purposes."""
    first = JUDGING_SEED + (PURPOSES.index(purpose) * 1_000 + seed) * SEEDS_EACH
    return range(first, first + episodes)


def horizons_of(cfg: EvaluateConfig, run: TrainedRun) -> tuple[int, ...]:
    """The configured horizons and the run's own, ascending.

    Raises:
        ConfigError: if one is longer than an episode can be.
    """
    longest = run.task.max_episode_steps
    if cfg.horizons_steps is None:
        return tuple(sorted({*(steps for steps in HORIZONS_STEPS if 2 * steps <= longest), run.horizon_steps}))
    if not all(1 <= steps <= longest for steps in cfg.horizons_steps):
        raise ConfigError(
            f"evaluate.horizons_steps={list(cfg.horizons_steps)}: allowed is at least 1 and at most {longest}, "
            "the length of the longest episode"
        )
    return tuple(sorted({*cfg.horizons_steps, run.horizon_steps}))


def take_moments(run: TrainedRun, policy: Policy, seeds: Sequence[int], plan: Plan) -> list[TakenMoment]:
    """Roll out an episode for each seed and take the moments of the plan.

    Args:
        run: provides the environments and the instructor.
        policy: the greedy policy.
        seeds: of held-out episodes.
        plan: which moments.
    """
    envs = [run.make_env() for _ in range(min(len(seeds), EPISODES_AT_ONCE))]
    instructor = make_instructor(stand_in(run.config.instructor, run.folder), run.task)
    taken: list[TakenMoment] = []
    for number, (episode, moments) in enumerate(rollouts_with_moments(envs, policy, instructor, seeds)):
        taken += _of_episode(episode, moments, number, seeds[number], plan, run.task)
    return taken


def _of_episode(
    episode: Episode, moments: Sequence[Moment], number: int, seed: int, plan: Plan, task: Task
) -> list[TakenMoment]:
    """The moments of the plan in one episode."""
    observed = _observed_step(episode, plan, task)
    regular = range(0, len(episode), plan.stride_steps)
    ahead = np.array(plan.horizons_steps)
    return [
        TakenMoment(
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
    """The step of the observer's prediction, a fixed time before the first contact or, if none is declared, the end.

    None with too few steps before it.
    """
    if plan.observer_steps is None:
        return None
    end = len(episode) if task.first_contact is None else task.first_contact(episode.states)
    if end < SEEN_STEPS + plan.observer_steps:
        return None
    return end - plan.observer_steps


def predict_futures(
    taken: Sequence[TakenMoment], policy: Policy, predictor: Predictor, plan: Plan, title: str
) -> Moments:
    """Sample ``plan.futures`` futures of each moment, with a progress bar."""
    futures = [one.moment for one in taken for _ in range(plan.futures)]
    starts, ahead = range(0, len(futures), FUTURES_AT_ONCE), np.array(plan.horizons_steps)
    changes, trusted = [], []
    with progress_bar(title, len(starts)) as advance:
        for start in starts:
            predicted = predictor.rollout(futures[start : start + FUTURES_AT_ONCE], policy, plan.horizons_steps[-1])
            changes.append(predicted.paths[:, ahead] - predicted.paths[:, :1])
            trusted.append(predicted.trusted_steps[:, None] >= ahead)
            advance()
    shape = (len(taken), plan.futures, len(ahead))
    of_moment, of_taken = (
        ("state", "instruction", "given"),
        ("episode", "seed", "step", "regular", "observed", "realised"),
    )
    return Moments(
        **{name: np.array([getattr(one.moment, name) for one in taken]) for name in of_moment},
        **{name: np.array([getattr(one, name) for one in taken]) for name in of_taken},
        predicted=np.concatenate(changes).reshape(*shape, -1),
        trusted=np.concatenate(trusted).reshape(shape),
        horizons_steps=plan.horizons_steps,
    )


@dataclass(frozen=True)
class Rollouts:
    """Rolls out the episodes of an evaluation, with common settings."""

    run: TrainedRun
    cfg: ExplainConfig
    predictor: Predictor

    def gather(self, purpose: str, episodes: int, plan: Plan, title: str, policy: Policy | None = None) -> Moments:
        """Roll out episodes for a purpose, with the run's last policy or another one, and predict futures."""
        followed = policy or self.run.policy
        taken = take_moments(self.run, followed, seeds_for(purpose, self.cfg.evaluate.seed, episodes), plan)
        return predict_futures(taken, followed, self.predictor, plan, title)

    def judged_and_held_out(self, horizons: tuple[int, ...]) -> tuple[Moments, Moments]:
        """The moments to evaluate, with the observer's, and those to calibrate the confidence on."""
        config = self.cfg.evaluate
        plan = Plan(config.stride_steps, self.cfg.predictor.futures, horizons, self.run.horizon_steps)
        judged = self.gather("judged", config.episodes, plan, "futures of the judged episodes")
        plan = replace(plan, observer_steps=None)
        held_out = self.gather("held_out", config.calibration_episodes, plan, "futures of the held-out episodes")
        return judged, held_out.judged()
