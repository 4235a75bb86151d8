"""Quality of explanations: do they come true?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import spearmanr
from sklearn.metrics import roc_auc_score

from ibe_rl.ibe.delta import Windows, delta_states
from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.ibe.word_meaning import asked_motion, expected_motion
from ibe_rl.metrics.bootstrap import weighted_auc, weighted_f1, weighted_spearman
from ibe_rl.task import Phrases, Task
from ibe_rl.types import CANNOT_TELL, Array, Episode, Explanation, ExpressionMapping

SCORES = ("motion_auc", "motion_auc_disobeyed", "motion_spearman", "instruction_f1", "echo_auc")
"""Metrics of ``vocabulary_scores``."""
OF_THE_MOMENTS = "echo_auc"
"""The one of them that depends on the moments only, not on the vocabulary."""


def realised_phrases(
    episode: Episode, horizon_steps: int, mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> list[str]:
    """The phrase of the real change over the horizon, from each of the ``T`` steps of an episode.

    Windows that reach past the end of the episode end there.
    """
    realised = delta_states(episode.states, horizon_steps, end="clamp")
    return list(phrases_of(mapping.express(realised), vocabulary))


def phrase_hits(
    episode: Episode, said: Sequence[Explanation], mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> Array:
    """The moments of an episode at which the explained phrase equals that of ``realised_phrases``.

    Args:
        episode: ``T`` steps.
        said: ``T`` explanations, one before each step.
        mapping: the mapping of the explanations.
        vocabulary: the words of the explanations.

    Returns:
        ``(T,)`` 1 or 0, NaN where the meaning of the word is unknown.
    """
    real = realised_phrases(episode, said[0].horizon_steps, mapping, vocabulary)
    pairs = zip(said, real, strict=True)
    return np.array([float(one.phrase == other) if one.meant else np.nan for one, other in pairs])


def phrase_accuracy(true: Array) -> float:
    """Mean of ``phrase_hits`` without NaN; NaN if none is left."""
    counted = true[~np.isnan(true)]
    return float(counted.mean()) if len(counted) else float("nan")


def outcomes(
    episode: Episode, horizon_steps: int, mapping: ExpressionMapping, vocabulary: Sequence[Phrases]
) -> list[str]:
    """As ``realised_phrases``, for display: changes without a known word are marked."""
    known = mapping.knows(delta_states(episode.states, horizon_steps, end="clamp"))
    real = realised_phrases(episode, horizon_steps, mapping, vocabulary)
    return [word if knows else CANNOT_TELL for word, knows in zip(real, known, strict=True)]


def mean_over_numbers(metric: str, each: Sequence[Array]) -> Array:
    """Mean of a metric over the numbers of an instruction.

    Whether a motion AUC is defined depends on the moments alone. A number without one, for example if all motion
    follows the instruction, is left out for all explainers.

    Args:
        metric: its name.
        each: values ``(R,)`` of each number, the value itself first.
    """
    of_auc = metric.startswith("motion_auc") or metric == OF_THE_MOMENTS
    known = [values for values in each if not np.isnan(values[0])] if of_auc else []
    mean: Array = np.mean(known or each, axis=0)
    return mean


def direction(change: Array, band: float | Array) -> Array:
    """Direction of changes ``(N,)``, or ``(N, d)`` with ``d`` bands: -1, 1, or 0 within the band."""
    return np.where(np.abs(change) > band, np.sign(change), 0).astype(int)


def motion_auc(expression: Array, change: Array, band: float) -> float:
    """AUC of an expression for the direction of motion, without a threshold on the expression.

    Args:
        expression: ``(W,)`` explained.
        change: ``(W,)`` real change of the explained dimension.
        band: a change of greater magnitude counts as motion.

    Returns:
        Mean of AUC(expression, went up) and AUC(-expression, went down): 1 is perfect, .5 is chance. NaN if one of
        the two directions never or always occurs.
    """
    ways = direction(change, band)
    if any(went.all() or not went.any() for went in (ways > 0, ways < 0)):
        return float("nan")
    return float(_both_ways(expression, ways, lambda score, went: float(roc_auc_score(went, score))))


def _both_ways(expression: Array, ways: Array, auc: Callable[[Array, Array], Any]) -> Any:
    """Mean AUC of both directions, by ``auc`` of scores and positives: scikit-learn's or a resampled one."""
    return (auc(expression, ways > 0) + auc(-expression, ways < 0)) / 2


def motion_spearman(expression: Array, change: Array) -> float:
    """Spearman correlation of expressions ``(W,)`` and real changes ``(W,)``; NaN if one is constant."""
    if np.ptp(expression) == 0 or np.ptp(change) == 0:
        return float("nan")
    return float(spearmanr(expression, change).statistic)


def resampled_motion_auc(expression: Array, ways: Array, weights: Array) -> Array:
    """``motion_auc`` ``(R,)`` on every resample.

    Args:
        expression: ``(N,)`` explained.
        ways: ``(N,)`` real directions, see ``direction``.
        weights: ``(R, N)``, see ``episode_weights``.
    """
    scores: Array = _both_ways(expression, ways, lambda score, went: weighted_auc(score, went, weights))
    return scores


def motion_scores(
    expression: Array, change: Array, instruction: Array, band: float, weights: Array, hard: Array | None = None
) -> dict[str, Array]:
    """``motion_auc`` and ``motion_spearman`` on every resample.

    Args:
        expression: ``(N,)`` explained.
        change: ``(N,)`` real change of the explained dimension.
        instruction: ``(N,)``.
        band: see ``motion_auc``.
        weights: ``(R, N)``, see ``episode_weights``.
        hard: ``(N,)`` bool, moments whose direction a simple forecast gets wrong, or None.

    Returns:
        Metric to ``(R,)``, NaN where undefined. ``motion_auc_disobeyed`` is on the moments whose direction is not the
        instructed one, ``motion_auc_hard`` on the hard ones.
    """
    ways = direction(change, band)

    def auc(rows: Array) -> Array:
        return resampled_motion_auc(expression[rows], ways[rows], weights[:, rows])

    return {
        "motion_auc": auc(np.ones(len(ways), bool)),
        "motion_auc_disobeyed": auc(ways != np.sign(instruction)),
        "motion_auc_hard": np.full(len(weights), np.nan) if hard is None else auc(hard),
        "motion_spearman": weighted_spearman(expression, change, weights),
    }


def instruction_f1(expression: Array, instruction: Array, values: Sequence[float], weights: Array) -> Array:
    """Macro-F1 ``(R,)`` of the instruction value nearest to each expression ``(N,)``, against the instruction ``(N,)``.

    It is descriptive, not a goal: an echo of the instruction scores 1.
    """
    allowed = np.asarray(values)
    said, real = (np.abs(each[:, None] - allowed).argmin(axis=1) for each in (expression, instruction))
    return weighted_f1(said, real, len(allowed), weights)


def word_f1(said: Array, real: Array, told: Array, weights: Array) -> Array:
    """Macro-F1 ``(R,)`` of spoken words against those of the realised movements, over all words that were told.

    A word that the agent is told and never says counts 0, so that one word for everything is no good vocabulary.

    Args:
        said: ``(N,)`` slots of the spoken words.
        real: ``(N,)`` of the realised movements.
        told: ``(N,)`` of the instructions.
        weights: ``(R, N)``.
    """
    each = []
    for slot in np.unique(told):
        counts = weights @ ((said == slot).astype(float) + (real == slot))
        hits = weights @ ((said == slot) & (real == slot))
        each.append(np.divide(2 * hits, counts, out=np.zeros(len(weights)), where=counts > 0))
    return np.asarray(np.mean(each, axis=0))


def vocabulary_scores(mapping: ExpressionMapping, windows: Windows, task: Task) -> dict[str, float]:
    """Evaluate a vocabulary without a predictor: express the real changes and score the expressions.

    Each number of an expression is compared with the dimension that ``task`` declares for it; scores are means over
    the numbers (``mean_over_numbers``). As the prediction is exact here, ``vocabulary_loss`` is 1 - ``motion_auc``.

    Args:
        mapping: the vocabulary.
        windows: with an instruction, of the episodes to evaluate on.
        task: the environment's own.

    Returns:
        Metric to value, NaN where undefined: ``motion_auc``; ``motion_auc_disobeyed``, the same on windows whose
        direction is not the instructed one; ``motion_spearman``; ``instruction_f1``; and ``echo_auc``, the
        ``motion_auc`` of the instruction at the beginning of the window.
    """
    return mean_scores(number_scores(mapping, windows, task))


def number_scores(mapping: ExpressionMapping, windows: Windows, task: Task) -> list[dict[str, float]]:
    """As ``vocabulary_scores``, for each number of the instruction."""
    if not len(windows):  # the newest episodes may all lack instructions
        return [dict.fromkeys(SCORES, float("nan"))] * len(task.explained)
    said, change = mapping.express(windows.delta), windows.delta[:, task.explained]
    said = expected_motion(mapping, said, task.explained)
    asked = asked_motion(mapping, windows.instruction, task.explained, task.explained_band)
    return [
        _number_scores(said[:, i], change[:, i], asked[:, i], band, task.directions)
        for i, band in enumerate(task.explained_band)
    ]


def mean_scores(each: Sequence[dict[str, float]]) -> dict[str, float]:
    """Means of ``number_scores``."""
    return {name: float(mean_over_numbers(name, [np.array([scores[name]]) for scores in each])[0]) for name in SCORES}


def episode_scores(
    episode: Episode, said: Sequence[Explanation], task: Task, mapping: ExpressionMapping | None = None
) -> list[dict[str, float]]:
    """``motion_auc`` and ``echo_auc`` of each number, over the explanations of one episode.

    Args:
        episode: ``T`` steps.
        said: ``T`` explanations; those of unknown meaning are left out.
        task: the environment's own.
        mapping: the vocabulary, from which it is known where words lead; numbers do without.
    """
    change = delta_states(episode.states, said[0].horizon_steps, end="clamp")[:, task.explained]
    meant = np.array([one.meant for one in said], bool)
    expressions = expected_motion(mapping, movements_said(said), task.explained)
    told = asked_motion(mapping, np.asarray(episode.instructions), task.explained, task.explained_band)
    return [
        {
            "motion_auc": motion_auc(expressions[meant, i], change[meant, i], band),
            "echo_auc": motion_auc(told[meant, i], change[meant, i], band),
        }
        for i, band in enumerate(task.explained_band)
    ]


def _number_scores(
    said: Array, change: Array, instruction: Array, band: float, values: Sequence[float]
) -> dict[str, float]:
    """The scores of one number of the instruction, all arguments ``(W,)``."""
    disobeyed = direction(change, band) != np.sign(instruction)
    return {
        "motion_auc": motion_auc(said, change, band),
        "motion_auc_disobeyed": motion_auc(said[disobeyed], change[disobeyed], band),
        "motion_spearman": motion_spearman(said, change),
        "instruction_f1": float(instruction_f1(said, instruction, values, np.ones((1, len(said))))[0]),
        "echo_auc": motion_auc(instruction, change, band),
    }
