"""An agent made ready for a study: it flies beforehand, for the paper's vocabulary and the simulated observer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ibe_rl.apps.paper.vocabularies import best_of
from ibe_rl.apps.study.arms import instructor_of
from ibe_rl.collect.rollout import play
from ibe_rl.config.hydra_setup import choice, settings_at_hand
from ibe_rl.evaluation.rollouts import seeds_for
from ibe_rl.evaluation.runs import earlier_state, kept_policies, kept_refreshes
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.ibe.delta import cut_windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.metrics.observer import Observer, calibrate_observer
from ibe_rl.types import ConfigError, Episode
from ibe_rl.vocabulary.fitting import fit_mapping

_ENVS_AT_ONCE = 25


@dataclass(frozen=True)
class FlownAgent:
    """An agent and how it behaves.

    Attributes:
        run: the agent, with its own vocabulary.
        episodes: that it flew; none of them is shown.
        paper: the paper's vocabulary, learnt from these; None if they are too few for it.
    """

    run: TrainedRun
    episodes: Sequence[Episode]
    paper: ClusterMapping | None

    @property
    def skill(self) -> tuple[float, float]:
        """Share of successes, then mean return: whose are higher is the better agent."""
        rewards = [episode.total_reward for episode in self.episodes]
        return float(np.mean([episode.success for episode in self.episodes])), float(np.mean(rewards))

    @property
    def observer(self) -> Observer:
        """A simulated observer that knows how far this agent typically goes; 0 if it never goes anywhere."""
        changes = cut_windows(self.episodes, self.run.horizon_steps, "clamp").delta[:, self.run.task.explained[0]]
        known = calibrate_observer(changes.astype(float), self.run.task.explained_band[0])
        return Observer(0.0) if np.isnan(known.typical) else known


def fly(run: TrainedRun, flights: int, seed: int) -> FlownAgent:
    """Fly with the greedy policy, and learn the paper's vocabulary from that."""
    seeds = seeds_for("flown", seed, flights)
    envs = [run.make_env() for _ in range(min(flights, _ENVS_AT_ONCE))]
    episodes = play(envs, run.policy, instructor_of(run), seeds)
    for env in envs:
        env.close()
    with settings_at_hand():
        paper = choice("mapping", "paper")
    try:
        learnt = fit_mapping(best_of(episodes, paper), episodes, paper, run.task, seed, horizon_steps=run.horizon_steps)
    except TooLittleDataError:
        learnt = None
    return FlownAgent(run, episodes, learnt)


def earlier_in(run: TrainedRun) -> TrainedRun:
    """The same run as it was halfway: the middle one of its earlier policies that have a vocabulary.

    Raises:
        ConfigError: if it kept no earlier one.
    """
    kept, policies = kept_refreshes(run), kept_policies(run)
    frames = [frame for frame in policies if min(kept) <= frame < run.policy_frame]
    if not frames:
        raise ConfigError(
            f"other=null with run={run.folder}: it kept no earlier policy with a vocabulary; allowed is another run to "
            "compare it with"
        )
    return earlier_state(run, frames[len(frames) // 2])


def check_same_task(run: TrainedRun, other: TrainedRun, folder: Path | str) -> None:
    """Refuse to compare agents of different environments.

    Raises:
        ConfigError: naming both.
    """
    if (other.task.name, other.task.state_names) != (run.task.name, run.task.state_names):
        raise ConfigError(f"other={folder}: it is of {other.task.name}; allowed is a run of {run.task.name}")
