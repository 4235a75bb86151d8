"""The one step that is under test: from what was flown to a vocabulary."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.meaning.flown import Flown
from ibe_rl.command_line import composed
from ibe_rl.config import MappingConfig
from ibe_rl.ibe import ClusterMapping
from ibe_rl.log import TrajectoryLog
from ibe_rl.refresh import learn_vocabulary


def learn(flown: Flown, seed: int) -> ClusterMapping:
    """Learn the vocabulary as ``explain.py agent=`` does.

    Raises:
        TooLittleDataError: if the log teaches none.
    """
    config = replace(axis(), horizon_steps=flown.horizon_steps, spans_steps=[], newest_frames=None)
    with TemporaryDirectory() as folder:
        return learn_vocabulary(filled(Path(folder), flown), config, flown.task, seed).mapping


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
