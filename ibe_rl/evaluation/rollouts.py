"""The flights that explanations are judged on: which seeds, which policy, which futures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import torch

from ibe_rl.apps.external.policy import crosses_processes
from ibe_rl.collect.rollout import JUDGING_SEED
from ibe_rl.config.settings import EvaluateConfig, ExplainConfig
from ibe_rl.evaluation.moments import Moments, Plan, gather
from ibe_rl.evaluation.run_predictor import predictor_of, with_processes
from ibe_rl.evaluation.runs import TrainedRun
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.types import ConfigError, Policy, Predictor

SEEDS_EACH = 10_000
"""Seeds of one purpose at one ``evaluate.seed``; there are 1,000 of these seeds for each purpose."""
PURPOSES = ("judged", "held_out", "changing", "screened", "flown", "checked", "foretold")
PROCESSES = 2
"""That roll out the futures of many moments, unless something else is asked for."""


def seeds_for(purpose: str, seed: int, episodes: int) -> range:
    """Seeds of episodes that no training and no other purpose uses."""
    first = JUDGING_SEED + (PURPOSES.index(purpose) * 1_000 + seed) * SEEDS_EACH
    return range(first, first + episodes)


def horizons_of(cfg: EvaluateConfig, run: TrainedRun) -> tuple[int, ...]:
    """The horizons asked for and the run's own, rising.

    Raises:
        ConfigError: if one of them is longer than an episode can be.
    """
    longest = run.task.max_episode_steps
    if not all(1 <= steps <= longest for steps in cfg.horizons_steps):
        raise ConfigError(
            f"evaluate.horizons_steps={list(cfg.horizons_steps)}: allowed is at least 1 and at most {longest}, "
            "the length of the longest episode"
        )
    return tuple(sorted({*cfg.horizons_steps, run.horizon_steps}))


@dataclass(frozen=True)
class Flying:
    """What all flights of an evaluation share."""

    run: TrainedRun
    cfg: ExplainConfig
    predictor: Predictor

    def gather(self, purpose: str, episodes: int, plan: Plan, title: str, policy: Policy | None = None) -> Moments:
        """Fly episodes for a purpose, with the run's last policy or another one, and predict."""
        run, seeds = self.run, seeds_for(purpose, self.cfg.evaluate.seed, episodes)
        instructor = make_instructor(stand_in(run.config.instructor), run.task)
        return gather(run.make_env, run.task, policy or run.policy, instructor, self.predictor, seeds, plan, title)


def processes_for(asked: int | None, policy: Policy) -> int:
    """How many processes share the futures; a policy that other processes cannot be given is followed in this one.

    Raises:
        ConfigError: if more are asked for such a policy.
    """
    if (asked or PROCESSES) == 1 or crosses_processes(policy):
        return asked or PROCESSES
    if asked:
        raise ConfigError(f"predictor.processes={asked}: the agent cannot be sent to other processes; allowed is 1")
    return 1


@contextmanager
def flying(run: TrainedRun, cfg: ExplainConfig) -> Iterator[Flying]:
    """Start the predictor's processes, and stop them at the end."""
    torch.set_num_threads(1)
    config = with_processes(cfg.predictor, processes_for(cfg.predictor.processes, run.policy))
    with predictor_of(run, config, cfg.evaluate.seed) as predictor:
        yield Flying(run, cfg, predictor)


def gather_both(flight: Flying, horizons: tuple[int, ...]) -> tuple[Moments, Moments]:
    """The moments that are judged, the observer's among them, and those that the confidence is calibrated on."""
    config, own = flight.cfg.evaluate, flight.run.horizon_steps
    plan = Plan(config.stride_steps, flight.cfg.predictor.futures, horizons, own)
    judged = flight.gather("judged", config.episodes, plan, "futures of the judged episodes")
    plan = replace(plan, observer_steps=None)
    held_out = flight.gather("held_out", config.calibration_episodes, plan, "futures of the held-out episodes")
    return judged, held_out.judged()
