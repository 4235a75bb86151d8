"""The step under test: from logged episodes to a vocabulary."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.meaning.trial import Trial
from ibe_rl.config.command_line import composed
from ibe_rl.envs.instructed_envs import TRAINING_SEEDS, episode_seed
from ibe_rl.ibe import ClusterMapping, IBEConfig, Reactions
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_during_rollouts


def learn(trial: Trial, seed: int) -> ClusterMapping:
    """Learn the vocabulary as ``explain.py agent=`` does.

    Raises:
        TooLittleDataError: if the log teaches none.
    """
    config = replace(axis(), horizon_steps=trial.horizon_steps, spans_steps=[], newest_frames=None)
    reactions = told_otherwise(trial, seed) if trial.sees_instruction else None
    with TemporaryDirectory() as folder:
        return learn_vocabulary(filled(Path(folder), trial), config, trial.task, seed, reactions=reactions).mapping


def told_otherwise(trial: Trial, seed: int) -> Reactions | None:
    """The agent's reactions to other instructions, in exact copies of the environment."""
    typical_steps = int(np.median([len(episode) for episode in trial.log_episodes]))
    envs = [trial.make_env() for _ in range(ASKED_AT)]
    seeds = [2 * TRAINING_SEEDS + episode_seed(seed, number) for number in range(ASKED_AT)]
    simulator = Simulator(trial.make_env, trial.task.rule, seed=seed)
    instructor = trial.make_instructor(seed)
    return ask_during_rollouts(envs, trial.policy, instructor, simulator, seeds, typical_steps, trial.horizon_steps)


def filled(folder: Path, trial: Trial) -> TrajectoryLog:
    """A log of the episodes."""
    rows = sum(len(episode) + 1 for episode in trial.log_episodes)
    log = TrajectoryLog(folder / "trajectories", rows, trial.task.contexts)
    for episode in trial.log_episodes:
        log.add(episode.as_steps(), trial.task.context)
    return log


@cache
def axis() -> IBEConfig:
    """``configs/mapping/axis.yaml``."""
    config: IBEConfig = composed("train", ["mapping=axis", "run_dir=unused"]).mapping
    return config
