"""The one step that is under test: from what was flown to a vocabulary."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.meaning.flown import Flown
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import MappingConfig
from ibe_rl.envs.make import TRAINING_SEEDS, episode_seed
from ibe_rl.ibe import ClusterMapping, Reactions
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary.fitting import learn_vocabulary
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_in_flight


def learn(flown: Flown, seed: int) -> ClusterMapping:
    """Learn the vocabulary as ``explain.py agent=`` does.

    Raises:
        TooLittleDataError: if the log teaches none.
    """
    config = replace(axis(), horizon_steps=flown.horizon_steps, spans_steps=[], newest_frames=None)
    reactions = told_otherwise(flown, seed) if flown.sees_instruction else None
    with TemporaryDirectory() as folder:
        return learn_vocabulary(filled(Path(folder), flown), config, flown.task, seed, reactions=reactions).mapping


def told_otherwise(flown: Flown, seed: int) -> Reactions | None:
    """What the agent does if it is told otherwise, in exact copies of the game."""
    typical_steps = int(np.median([len(episode) for episode in flown.log_episodes]))
    envs = [flown.make_env() for _ in range(ASKED_AT)]
    seeds = [2 * TRAINING_SEEDS + episode_seed(seed, number) for number in range(ASKED_AT)]
    simulator = Simulator(flown.make_env, flown.task.rule, seed=seed)
    instructor = flown.make_instructor(seed)
    return ask_in_flight(envs, flown.policy, instructor, simulator, seeds, typical_steps, flown.horizon_steps)


def filled(folder: Path, flown: Flown) -> TrajectoryLog:
    """A log of the episodes."""
    rows = sum(len(episode) + 1 for episode in flown.log_episodes)
    log = TrajectoryLog(folder / "trajectories", rows, flown.task.contexts)
    for episode in flown.log_episodes:
        log.add(episode.as_steps(), flown.task.context)
    return log


@cache
def axis() -> MappingConfig:
    """``configs/mapping/axis.yaml``."""
    config: MappingConfig = composed("train", ["mapping=axis", "run_dir=unused"]).mapping
    return config
