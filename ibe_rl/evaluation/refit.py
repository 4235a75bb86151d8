"""Vocabularies learnt anew from the log of a run: for other horizons, by other mappings, for controls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from ibe_rl.config.settings import EvaluateConfig, MappingConfig
from ibe_rl.evaluation.baselines import Learnt, fit_state_regressors
from ibe_rl.evaluation.controls import dealt, random_clusters, shuffle_instructions
from ibe_rl.evaluation.trained_run import TrainedRun, open_log
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Episode, ExpressionMapping
from ibe_rl.vocabulary.fitting import check_mapping, clusters_of, fit_mapping, interpret_lessons
from ibe_rl.vocabulary.training_episodes import TrainingEpisodes, best_windows, read_training_episodes

MOST_REDRAWN = 20
NONSENSE_WINDOWS = 2_000
"""At most so many windows are clustered where the instructions are shuffled."""


def fit_shuffled(
    best: Sequence[Episode],
    heard: Sequence[Episode],
    config: MappingConfig,
    task: Task,
    seed: int,
    horizon_steps: int,
    count: int,
    step: Callable[[], None] = lambda: None,
) -> list[ExpressionMapping]:
    """Learn ``count`` vocabularies, each from episodes that were given the instructions of others.

    A shuffle that no vocabulary can be learnt from (its axis may be one on which hardly anything moves) is drawn
    again; if that happens ``MOST_REDRAWN`` times as often as vocabularies are asked for, there are fewer of them.
    """
    random = np.random.default_rng(seed)
    quick = replace(config, n_init=1, max_fit_windows=NONSENSE_WINDOWS)
    found: list[ExpressionMapping] = []
    for _ in range(MOST_REDRAWN * count):
        lessons = shuffle_instructions(best, heard, random)
        try:
            found.append(fit_mapping(*lessons, quick, task, seed, horizon_steps=horizon_steps))
        except TooLittleDataError:
            continue
        step()
        if len(found) == count:
            break
    return found


class Refits:
    """Learns vocabularies from the log of one run, all from its newest episodes, as many as the run itself used.

    Args:
        run: with its log.
        seed: of the clustering and of all draws.

    Raises:
        ConfigError: if the run has no log.
    """

    def __init__(self, run: TrainedRun, seed: int):
        self._run, self._seed, self._log = run, seed, open_log(run.folder)

    def lessons(self, config: MappingConfig) -> TrainingEpisodes:
        """The episodes that ``config`` learns from.

        Raises:
            ConfigError: if there are none.
        """
        used = replace(config, newest_frames=self._run.config.mapping.newest_frames)
        with self._enough():
            return read_training_episodes(self._log, used, self._seed)

    def fit(self, config: MappingConfig, horizon_steps: int, lessons: TrainingEpisodes | None = None) -> ClusterMapping:
        """Learn a vocabulary from nothing, from the log or from given lessons.

        Raises:
            ConfigError: if they are too few, or the mapping cannot work in this environment.
        """
        check_mapping(replace(config, horizon_steps=horizon_steps, spans_steps=[]), self._run.task)
        given, task, seed = lessons or self.lessons(config), self._run.task, self._seed
        with self._enough():
            meant = interpret_lessons(given.heard, config, task, seed, horizon_steps, self._run.reactions)
            return fit_mapping(
                given.best, given.heard, config, task, seed, horizon_steps=horizon_steps, interpretation=meant
            )

    def shuffled(
        self, config: MappingConfig, horizon_steps: int, count: int, step: Callable[[], None]
    ) -> list[ExpressionMapping]:
        """``count`` vocabularies, each from episodes that were given the instructions of others.

        Raises:
            ConfigError: if hardly any of them teaches a vocabulary.
        """
        lessons, task = self.lessons(config), self._run.task
        found = fit_shuffled(lessons.best, lessons.heard, config, task, self._seed, horizon_steps, count, step)
        if len(found) < count:
            raise ConfigError(
                f"evaluate.shuffles={count}: hardly any of them taught a vocabulary; allowed is a larger log"
            )
        return found

    def random_clusters(self, config: MappingConfig, horizon_steps: int, count: int) -> list[ExpressionMapping]:
        """``count`` vocabularies with clusters around windows drawn at random."""
        random, lessons = np.random.default_rng(self._seed), self.lessons(config)
        with self._enough():
            windows = best_windows(lessons.best, config, horizon_steps)
        return [random_clusters(windows, clusters_of(config, self._run.task), random) for _ in range(count)]

    def learn(
        self,
        vocabularies: dict[str, ClusterMapping],
        paper: MappingConfig,
        horizon_steps: int,
        config: EvaluateConfig,
        step: Callable[[], None] = lambda: None,
    ) -> Learnt:
        """All that is held against the ``vocabularies`` in question at one horizon; ``step`` is called now and then.

        Raises:
            ConfigError: if the log is too small for it.
        """
        own, random = self._run.config.mapping, np.random.default_rng(self._seed)
        ours = next(iter(vocabularies.values()))
        return Learnt(
            vocabularies={**vocabularies, "baseline:paper": self.fit(paper, horizon_steps)},
            ensembles={
                "baseline:shuffled": self.shuffled(own, horizon_steps, config.shuffles, step),
                "baseline:random_clusters": self.random_clusters(own, horizon_steps, config.shuffles),
                "baseline:random_names": [dealt(ours, random) for _ in range(config.shuffles)],
            },
            regressors=fit_state_regressors(self.lessons(own).heard, horizon_steps, self._run.task, self._seed),
        )

    @contextmanager
    def _enough(self) -> Iterator[None]:
        try:
            yield
        except TooLittleDataError as error:
            raise ConfigError(f"run={self._run.folder}: its log is too small for a vocabulary ({error})") from None
