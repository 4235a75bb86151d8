"""Learns a vocabulary of words, whichever mapping is asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.settings import IBEConfig
from ibe_rl.ibe.word_mapping import fit_words, with_word_meanings
from ibe_rl.task import Task
from ibe_rl.types import Array


def fit_worded(
    windows: Windows,
    states: Array,
    instructions: Array,
    config: MappingConfig,
    task: Task,
    estimator: Any,
    seed: int,
) -> ClusterMapping:
    """Learn a vocabulary of words: by ``fit_words`` where axes of the rule are asked for, else as of numbers.

    Args:
        windows: of the best episodes, each with a word.
        states: ``(N, S)`` with a word, of good and bad episodes.
        instructions: ``(N, d)`` these words.
        config: of the mapping.
        task: with words.
        estimator: of the mapping's kind.
        seed: of the clustering.

    Raises:
        TooLittleDataError: as the mapping.
    """
    if isinstance(config, IBEConfig) and config.space == "rule":
        return fit_words(
            windows,
            states,
            instructions,
            clusters_per_axis=config.n_clusters,
            kept=np.isin(task.state_names, config.dimensions or task.state_names),
            n_init=config.n_init,
            max_fit_windows=config.max_fit_windows,
            seed=seed,
        )
    heard: Array = np.asarray(windows.instruction).max(axis=0) > 0
    fitted = estimator.fit(windows.delta, windows.instruction[:, heard], states, instructions[:, heard])
    return with_word_meanings(_with_all(fitted.mapping_, heard), windows)


def _with_all(mapping: ClusterMapping, heard: Array) -> ClusterMapping:
    """A mapping of the words that were ``heard`` ``(d,)`` bool, with columns for the others, which are never spoken."""
    means, expressions = np.zeros((2, len(mapping.ids), len(heard)))
    expressions += min(0.0, float(mapping.expressions.min()))
    means[:, heard], expressions[:, heard] = mapping.mean_instructions, mapping.expressions
    membership = mapping.membership if mapping.membership == "soft" else "hard"
    return replace(mapping, mean_instructions=means, expressions=expressions, membership=membership)
