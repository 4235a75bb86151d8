"""Vocabularies learnt anew from the log of a run: for other horizons, by other mappings, for controls."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ibe_rl.config import MappingConfig
from ibe_rl.data import ConfigError, Episode, Task
from ibe_rl.evaluation.runs import TrainedRun
from ibe_rl.ibe import ClusterMapping, PaperMapping, TooLittleDataError, cut_windows, top_episodes
from ibe_rl.log import TrajectoryLog
from ibe_rl.run_folder import TRAJECTORIES


@dataclass(frozen=True)
class Lessons:
    best: list[Episode]
    heard: list[Episode]


def read_lessons(log: TrajectoryLog, config: MappingConfig, task: Task, seed: int) -> Lessons:
    index = log.index
    counted = np.arange(len(index))
    if config.newest_frames is not None:
        counted = np.flatnonzero(index["frame"] > log.frames - config.newest_frames)
    if not len(counted):
        raise TooLittleDataError("no episode")
    best = top_episodes(index["total_reward"][counted], config.top_fraction, None)
    return Lessons(log.read(counted[best]), log.read(counted))


def fit_mapping(best, heard, config: MappingConfig, task: Task, seed: int, last=None) -> ClusterMapping:  # type: ignore
    top = cut_windows(best, config.horizon_steps, config.window_end)
    top = top[np.asarray(top.given)]
    dims = [task.state_names.index(name) for name in config.dimensions] or None
    return (
        PaperMapping(config.n_clusters, config.normalisation, dims, config.n_init, random_state=seed)
        .fit(top.delta, top.instruction)
        .mapping_
    )


def open_log(run: TrainedRun) -> TrajectoryLog:
    """Open the log of a run.

    Raises:
        ConfigError: if there is none, or it is damaged or empty.
    """
    try:
        log = TrajectoryLog.open(run.folder / TRAJECTORIES)
    except ValueError as error:
        raise ConfigError(
            f"run={run.folder}: it has no log to learn other vocabularies from; allowed is a run as train.py leaves it "
            f"({error})"
        ) from None
    if not len(log.index):
        raise ConfigError(f"run={run.folder}: its log in {TRAJECTORIES} holds no whole episode")
    return log


class Refits:
    """Learns vocabularies from the log of one run.

    All use the newest episodes that the run's own mapping would use; ``seed`` is that of the clustering.

    Raises:
        ConfigError: if the run has no log.
    """

    def __init__(self, run: TrainedRun, seed: int):
        self._run, self._seed, self._log = run, seed, open_log(run)

    def lessons(self, config: MappingConfig, horizon_steps: int) -> tuple[Lessons, MappingConfig]:
        """The episodes that ``config`` would learn from, and ``config`` as it is used on this log.

        Raises:
            ConfigError: if there are too few of them.
        """
        used = replace(config, horizon_steps=horizon_steps, newest_frames=self._run.config.mapping.newest_frames)
        try:
            return read_lessons(self._log, used, self._run.task, self._seed), used
        except TooLittleDataError as error:
            raise ConfigError(f"run={self._run.folder}: its log is too small for a vocabulary ({error})") from None

    def fit(self, config: MappingConfig, horizon_steps: int) -> ClusterMapping:
        """Learn a vocabulary from nothing.

        Raises:
            ConfigError: if the log is too small for it.
        """
        lessons, used = self.lessons(config, horizon_steps)
        return self.fit_on(lessons, used)

    def fit_on(self, lessons: Lessons, config: MappingConfig) -> ClusterMapping:
        """Learn a vocabulary from these lessons.

        Raises:
            ConfigError: if they are too few.
        """
        try:
            return fit_mapping(lessons.best, lessons.heard, config, self._run.task, self._seed)
        except TooLittleDataError as error:
            raise ConfigError(f"run={self._run.folder}: its log is too small for a vocabulary ({error})") from None
