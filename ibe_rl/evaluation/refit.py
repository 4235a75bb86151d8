"""Refit vocabularies on the log of a run: for other horizons, other mappings and negative controls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ibe_rl.config.settings import EvaluateConfig, MappingConfig
from ibe_rl.evaluation.baselines import Learnt, fit_state_regressors
from ibe_rl.evaluation.controls import dealt, random_clusters, shuffle_instructions
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.trained_run import TrainedRun, open_log
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.settings import IBEConfig
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.ibe.word_mapping import with_word_meanings
from ibe_rl.runtime.pool import call_each
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Episode, ExpressionMapping
from ibe_rl.vocabulary.fitting import check_mapping, clusters_of, fit_mapping, interpret_lessons
from ibe_rl.vocabulary.training_episodes import TrainingEpisodes, best_windows, read_training_episodes

MOST_REDRAWN = 20
SHUFFLED_CONTROL = "baseline:shuffled"
"""Name of the control with shuffled instructions; it is missing where none of them gives a vocabulary."""
NONSENSE_WINDOWS = 2_000
"""Most windows to cluster for the control with shuffled instructions."""


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
    """Learn ``count`` vocabularies, each from episodes with shuffled instructions.

    A shuffle that allows no vocabulary, for example if its axis hardly varies, is drawn again. After ``MOST_REDRAWN``
    times ``count`` redraws fewer vocabularies are returned. ``step`` is called after each vocabulary.
    """
    random = np.random.default_rng(seed)
    quick = config
    if isinstance(config, IBEConfig):
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
    """Learns vocabularies from the newest episodes in the log of a run, as many as the run itself used.

    Args:
        run: with its log.
        seed: of the clustering and all draws.

    Raises:
        ConfigError: if the run has no log.
    """

    def __init__(self, run: TrainedRun, seed: int):
        self._run, self._seed, self._log = run, seed, open_log(run.folder)
        self._read: dict[str, TrainingEpisodes] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process opens the log itself, which can be larger than its memory."""
        return Refits, (self._run, self._seed)

    def each(self, method: str, calls: Sequence[tuple[Any, ...]], processes: int) -> list[Any]:
        """What a method learns from the arguments of each call, several at once.

        Args:
            method: ``fit`` or ``learn_at``.
            calls: the arguments.
            processes: how many at once.
        """
        found = []
        with progress_bar("vocabularies", len(calls)) as step:
            for one in call_each(self, method, calls, processes):
                found.append(one)
                step()
        return found

    def lessons(self, config: MappingConfig) -> TrainingEpisodes:
        """The training episodes of ``config``, read once: how late the instructor is takes seconds to find.

        Raises:
            ConfigError: if there are none.
        """
        used = replace(config, newest_frames=self._run.config.mapping.newest_frames)
        if repr(used) not in self._read:
            with self._enough():
                self._read[repr(used)] = read_training_episodes(self._log, used, self._seed)
        return self._read[repr(used)]

    def fit(self, config: MappingConfig, horizon_steps: int, lessons: TrainingEpisodes | None = None) -> ClusterMapping:
        """Learn a vocabulary from scratch, from the log or from given lessons.

        Raises:
            ConfigError: if there are too few, or the mapping does not suit this environment.
        """
        check_mapping(replace(config, horizon_steps=horizon_steps, spans_steps=[]), self._run.task)
        given, task, seed = lessons or self.lessons(config), self._run.task, self._seed
        with self._enough():
            meant = interpret_lessons(given.heard, config, task, seed, horizon_steps, self._run.reactions)
            return fit_mapping(
                given.best, given.heard, config, task, seed, horizon_steps=horizon_steps, interpretation=meant
            )

    def shuffled(self, config: MappingConfig, horizon_steps: int, count: int) -> list[ExpressionMapping]:
        """At most ``count`` vocabularies, each from episodes with shuffled instructions; see ``fit_shuffled``."""
        lessons, task = self.lessons(config), self._run.task
        return fit_shuffled(lessons.best, lessons.heard, config, task, self._seed, horizon_steps, count)

    def random_clusters(self, config: MappingConfig, horizon_steps: int, count: int) -> list[ExpressionMapping]:
        """``count`` vocabularies with randomly drawn windows as cluster centres."""
        random, lessons = np.random.default_rng(self._seed), self.lessons(config)
        with self._enough():
            windows = best_windows(lessons.best, config, horizon_steps)
        task = self._run.task
        drawn = random_clusters(windows, clusters_of(config, task), random, count)
        return [one if task.words is None else with_word_meanings(one, windows) for one in drawn]

    def vocabulary_at(self, horizon_steps: int) -> ClusterMapping:
        """The run's vocabulary for a horizon; if it has none, one learnt from its log."""
        refreshed = {**self._run.spans, self._run.horizon_steps: self._run.mapping}
        return refreshed.get(horizon_steps) or self.fit(self._run.config.mapping, horizon_steps)

    def learn_at(self, horizon_steps: int, name: str, paper: MappingConfig, config: EvaluateConfig) -> Learnt:
        """All that is learnt for one horizon, where the run's vocabulary is called ``name``; see ``learn``."""
        return self.learn({name: self.vocabulary_at(horizon_steps)}, paper, horizon_steps, config)

    def learn(
        self,
        vocabularies: dict[str, ClusterMapping],
        paper: MappingConfig,
        horizon_steps: int,
        config: EvaluateConfig,
    ) -> Learnt:
        """Learn baselines and controls for the ``vocabularies`` at one horizon.

        Raises:
            ConfigError: if the log is too small for it.
        """
        own, random = self._run.config.mapping, np.random.default_rng(self._seed)
        ours = next(iter(vocabularies.values()))
        ensembles: dict[str, Sequence[ExpressionMapping]] = {
            SHUFFLED_CONTROL: self.shuffled(own, horizon_steps, config.shuffles),
            "baseline:random_clusters": self.random_clusters(own, horizon_steps, config.shuffles),
            "baseline:random_names": [dealt(ours, random) for _ in range(config.shuffles)],
        }
        return Learnt(
            vocabularies={**vocabularies, "baseline:paper": self.fit(paper, horizon_steps)},
            ensembles={name: several for name, several in ensembles.items() if several},
            regressors=fit_state_regressors(self.lessons(own).heard, horizon_steps, self._run.task, self._seed),
        )

    @contextmanager
    def _enough(self) -> Iterator[None]:
        try:
            yield
        except TooLittleDataError as error:
            raise ConfigError(f"run={self._run.folder}: its log is too small for a vocabulary ({error})") from None
