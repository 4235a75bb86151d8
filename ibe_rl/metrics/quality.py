"""Does what was said happen?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import spearmanr
from sklearn.metrics import roc_auc_score

from ibe_rl.ibe.delta import Windows, delta_states
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.metrics.bootstrap import weighted_auc, weighted_f1, weighted_spearman
from ibe_rl.task import Phrases, Task
from ibe_rl.types import CANNOT_TELL, Array, Episode, Explanation, ExpressionMapping

SCORES = ("motion_auc", "motion_auc_disobeyed", "motion_spearman", "instruction_f1", "echo_auc")
"""What ``vocabulary_scores`` tells."""
OF_THE_MOMENTS = "echo_auc"
"""The one of them that no vocabulary has a part in."""


def realised_phrases(
    episode: Episode, horizon_steps: int, mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> list[str]:
    """What a vocabulary calls the real change over the horizon, from each of the ``T`` steps of an episode.

    Windows that reach past the end of the episode end there.
    """
    realised = delta_states(episode.states, horizon_steps, end="clamp")
    return list(phrases_of(mapping.express(realised), vocabulary))


def phrase_hits(
    episode: Episode, said: Sequence[Explanation], mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> Array:
    """At which moments of an episode the spoken phrase is that of ``realised_phrases``.

    Args:
        episode: ``T`` steps.
        said: ``T`` explanations, one before each step.
        mapping: the mapping they were made with.
        vocabulary: the words they were made with.

    Returns:
        ``(T,)`` 1 or 0, NaN where the meaning of the word is not known: that says nothing.
    """
    real = realised_phrases(episode, said[0].horizon_steps, mapping, vocabulary)
    pairs = zip(said, real, strict=True)
    return np.array([float(one.phrase == other) if one.meant else np.nan for one, other in pairs])


def phrase_accuracy(true: Array) -> float:
    """Share of ``phrase_hits`` among the moments that count; NaN if there is none."""
    counted = true[~np.isnan(true)]
    return float(counted.mean()) if len(counted) else float("nan")


def outcomes(
    episode: Episode, horizon_steps: int, mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> list[str]:
    """As ``realised_phrases``, for people: what the vocabulary has no known word for is called so."""
    known = mapping.knows(delta_states(episode.states, horizon_steps, end="clamp"))
    real = realised_phrases(episode, horizon_steps, mapping, vocabulary)
    return [word if knows else CANNOT_TELL for word, knows in zip(real, known, strict=True)]


def mean_over_numbers(metric: str, each: Sequence[Array]) -> Array:
    """The mean of a metric over the numbers of an instruction.

    Whether a motion AUC can be told depends on the moments alone: a number of which it cannot (nobody ever went that
    way unasked) is left out, the same for whoever explains.

    Args:
        metric: its name.
        each: values ``(R,)`` of each number, the value itself first.
    """
    of_auc = metric.startswith("motion_auc") or metric == OF_THE_MOMENTS
    known = [values for values in each if not np.isnan(values[0])] if of_auc else []
    mean: Array = np.mean(known or each, axis=0)
    return mean


def direction(change: Array, band: float | Array) -> Array:
    """Direction of changes ``(N,)``, or ``(N, d)`` with ``d`` bands: -1, 1, or 0 up to the band."""
    return np.where(np.abs(change) > band, np.sign(change), 0).astype(int)


def motion_auc(expression: Array, change: Array, band: float) -> float:
    """How well an expression tells the direction of motion, without any threshold on the expression.

    Args:
        expression: ``(W,)`` what was said.
        change: ``(W,)`` real change of the explained dimension.
        band: a change beyond it, either way, counts as motion.

    Returns:
        Mean of AUC(expression, went up) and AUC(-expression, went down): 1 is perfect, .5 is chance. NaN if it never
        or always went one of the two ways.
    """
    ways = direction(change, band)
    if any(went.all() or not went.any() for went in (ways > 0, ways < 0)):
        return float("nan")
    return float(_both_ways(expression, ways, lambda score, went: float(roc_auc_score(went, score))))


def _both_ways(expression: Array, ways: Array, auc: Callable[[Array, Array], Any]) -> Any:
    """The mean of the two AUCs, by ``auc`` of scores and positives: scikit-learn's, or one for all resamples."""
    return (auc(expression, ways > 0) + auc(-expression, ways < 0)) / 2


def motion_spearman(expression: Array, change: Array) -> float:
    """Rank correlation of what was said ``(W,)`` with the real change ``(W,)``; NaN if one is constant."""
    if np.ptp(expression) == 0 or np.ptp(change) == 0:
        return float("nan")
    return float(spearmanr(expression, change).statistic)


def motion_scores(
    expression: Array, change: Array, instruction: Array, band: float, weights: Array, hard: Array | None = None
) -> dict[str, Array]:
    """``motion_auc`` and ``motion_spearman`` on every resample.

    Args:
        expression: ``(N,)`` what was said.
        change: ``(N,)`` real change of the explained dimension.
        instruction: ``(N,)``.
        band: see ``motion_auc``.
        weights: ``(R, N)``, see ``episode_weights``.
        hard: ``(N,)`` bool, the moments whose direction a simple forecast gets wrong, or None.

    Returns:
        Metric to ``(R,)``, NaN where the moments cannot tell. ``motion_auc_disobeyed`` is on the moments that did not
        go the way they were told, ``motion_auc_hard`` on the hard ones.
    """
    ways = direction(change, band)

    def auc(rows: Array) -> Array:
        scores: Array = _both_ways(
            expression[rows], ways[rows], lambda score, went: weighted_auc(score, went, weights[:, rows])
        )
        return scores

    return {
        "motion_auc": auc(np.ones(len(ways), bool)),
        "motion_auc_disobeyed": auc(ways != np.sign(instruction)),
        "motion_auc_hard": np.full(len(weights), np.nan) if hard is None else auc(hard),
        "motion_spearman": weighted_spearman(expression, change, weights),
    }


def instruction_f1(expression: Array, instruction: Array, values: Sequence[float], weights: Array) -> Array:
    """Macro-F1 ``(R,)`` of the instruction value nearest to what was said ``(N,)``, against the instruction ``(N,)``.

    A report, not a goal: an echo of the instruction scores 1.
    """
    allowed = np.asarray(values)
    said, real = (np.abs(each[:, None] - allowed).argmin(axis=1) for each in (expression, instruction))
    return weighted_f1(said, real, len(allowed), weights)


def vocabulary_scores(mapping: ExpressionMapping, windows: Windows, task: Task) -> dict[str, float]:
    """What can be had without a predictor: put into words what really realised_phrases, and see whether the words fit.

    Each number of the expressions is held against the dimension that ``task`` says it speaks of; the scores are the
    means over the numbers (``mean_over_numbers``). The predicted change being the real one, ``vocabulary_loss`` is
    1 - ``motion_auc``.

    Args:
        mapping: the vocabulary.
        windows: with an instruction, of episodes that it is to be judged on.
        task: the environment's own.

    Returns:
        Metric to value, NaN where the windows cannot tell: ``motion_auc``; ``motion_auc_disobeyed``,
        the same on windows that did not go the way they were told; ``motion_spearman``; ``instruction_f1``; and
        ``echo_auc``, the ``motion_auc`` of whoever repeats the instruction at the beginning of the window.
    """
    return mean_scores(number_scores(mapping, windows, task))


def number_scores(mapping: ExpressionMapping, windows: Windows, task: Task) -> list[dict[str, float]]:
    """As ``vocabulary_scores``, of each number of the instruction by itself."""
    if not len(windows):  # the newest episodes may all have been flown in silence
        return [dict.fromkeys(SCORES, float("nan"))] * task.instruction_size
    said, change = mapping.express(windows.delta), windows.delta[:, task.explained]
    return [
        _number_scores(said[:, i], change[:, i], windows.instruction[:, i], band, task.instruction_values)
        for i, band in enumerate(task.explained_band)
    ]


def mean_scores(each: Sequence[dict[str, float]]) -> dict[str, float]:
    """The means of ``number_scores``."""
    return {name: float(mean_over_numbers(name, [np.array([scores[name]]) for scores in each])[0]) for name in SCORES}


def episode_scores(episode: Episode, said: Sequence[Explanation], task: Task) -> list[dict[str, float]]:
    """``motion_auc`` and ``echo_auc`` of each number, of what was said in one episode.

    Args:
        episode: ``T`` steps.
        said: ``T`` explanations; those whose word has no known meaning are left out.
        task: the environment's own.
    """
    change = delta_states(episode.states, said[0].horizon_steps, end="clamp")[:, task.explained]
    meant = np.array([one.meant for one in said], bool)
    expressions = np.array([one.expression for one in said])
    return [
        {
            "motion_auc": motion_auc(expressions[meant, i], change[meant, i], band),
            "echo_auc": motion_auc(np.asarray(episode.instructions)[meant, i], change[meant, i], band),
        }
        for i, band in enumerate(task.explained_band)
    ]


def _number_scores(said: Array, change: Array, told: Array, band: float, values: Sequence[float]) -> dict[str, float]:
    """The scores of one number of the instruction, all arguments ``(W,)``."""
    disobeyed = direction(change, band) != np.sign(told)
    return {
        "motion_auc": motion_auc(said, change, band),
        "motion_auc_disobeyed": motion_auc(said[disobeyed], change[disobeyed], band),
        "motion_spearman": motion_spearman(said, change),
        "instruction_f1": float(instruction_f1(said, told, values, np.ones((1, len(said))))[0]),
        "echo_auc": motion_auc(told, change, band),
    }
