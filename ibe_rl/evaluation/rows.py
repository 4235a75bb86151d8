"""The metrics of one explainer on every resample of the episodes, and its row of the report.

Shapes: ``N`` moments, ``d`` numbers in an instruction, ``R`` resamples; row 0 is the point estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ibe_rl.evaluation.moments import Moments, Spoken
from ibe_rl.ibe.word_meaning import asked_motion, moves_of
from ibe_rl.metrics.balance import left_right, size_cv, size_max
from ibe_rl.metrics.bootstrap import estimate, weighted_mean
from ibe_rl.metrics.confidence import Calibration, brier, ece, risk_at
from ibe_rl.metrics.quality import direction, instruction_f1, mean_over_numbers, motion_scores, resampled_motion_auc
from ibe_rl.task import Task
from ibe_rl.types import Array, ExpressionMapping

Samples = dict[str, Array]
"""Metric to values ``(R,)``; with several numbers in an instruction also ``metric[i]`` of number i."""

MOTION = ("motion_auc", "motion_auc_disobeyed", "motion_auc_hard", "motion_spearman")
WORDS = ("came_true", "came_true_voted")
OWN_WORDS = ("word_f1",)
"""Of vocabularies of an instructor's own words only."""
CONFIDENCE = ("brier", "ece", "risk_at_80", "risk_all")
BALANCE = ("size_cv", "size_max", "left_right")
WHAT_IF = ("what_if_came_true", "what_if_ece", "listens")
OF_WORDS = "motion_auc_words"
"""The ``motion_auc`` of the words as they are spoken, without the number beside them."""
ROW_METRICS = (
    *MOTION,
    OF_WORDS,
    "vocabulary_loss",
    *WORDS,
    "instruction_f1",
    *CONFIDENCE,
    *BALANCE,
    "observer_error",
    *WHAT_IF,
)
"""The metrics of a row, in the order of the report."""
IN_EACH_ROW = ("explainer", "horizon_steps", "each", "over", "refits")
"""What else a row may hold; other columns are of metrics of one's own."""
EACH = (*MOTION, OF_WORDS, "vocabulary_loss", "instruction_f1")
"""Metrics reported for each number; the row itself holds their mean."""
COVERAGE = 0.8


@dataclass(frozen=True)
class Truth:
    """The ground truth over one horizon, and the weights of the moments.

    Attributes:
        horizon_steps: of the explanations.
        change: ``(N, d)`` real changes of the explained dimensions.
        instruction: ``(N, d)``.
        band: one for each number, see ``Task.explained_band``.
        values: the possible instructions.
        hard: ``(N, d)`` bool, the state regressor predicts the wrong direction.
        weights: ``(R, N)``.
    """

    horizon_steps: int
    change: Array
    instruction: Array
    band: tuple[float, ...]
    values: Sequence[float]
    hard: Array
    weights: Array

    @classmethod
    def of(
        cls,
        moments: Moments,
        horizon_steps: int,
        task: Task,
        forecast: Array,
        weights: Array,
        mapping: ExpressionMapping | None = None,
    ) -> Truth:
        """The truth of ``moments``, given a simple ``forecast`` ``(N, d)`` of the changes.

        With words, ``d`` is the number of explained dimensions, and ``mapping`` tells where each word leads.
        """
        change = moments.real_change(horizon_steps, task.explained).astype(float)
        band = task.explained_band
        hard = direction(forecast, np.array(band)) != direction(change, np.array(band))
        instruction = asked_motion(mapping, moments.instruction.astype(float), task.explained, band)
        return cls(horizon_steps, change, instruction, band, task.directions, hard, weights)

    def unweighed(self) -> Truth:
        """The same with one row of equal weights, for values without an interval."""
        return replace(self, weights=self.weights[:1])


@dataclass(frozen=True)
class Statements:
    """What one explainer said at ``N`` moments, and what was true; what metrics of one's own score.

    Attributes:
        explainer: its name in the report, as ``ibe:axis`` or ``baseline:constant``.
        said: ``(N, d)`` the expressions of a vocabulary, in [-1, 1]; for a baseline the changes that it foretells, in
            units of the state.
        on_scale: ``(N, d)`` the same on the instructor's scale.
        truth: real changes, instructions, and the weights of the moments on each resample.
        spoken: the phrases of a vocabulary; None for a baseline without one.
    """

    explainer: str
    said: Array
    on_scale: Array
    truth: Truth
    spoken: Spoken | None = None


@dataclass
class Judged:
    """The results at one horizon.

    Attributes:
        truth: the ground truth.
        names: of the numbers of an instruction.
        samples: explainer to its metrics on every resample.
        refits: explainer to the metrics of each of its vocabularies, without resamples.
        spoken: explainer to the explanations of its vocabulary.
        calibrations: explainer to the calibration of its confidence.
        probabilities: explainer to that confidence ``(N,)``.
        mappings: explainer to its vocabulary.
    """

    truth: Truth
    names: Sequence[str]
    samples: dict[str, Samples] = field(default_factory=dict)
    refits: dict[str, list[Samples]] = field(default_factory=dict)
    spoken: dict[str, Spoken] = field(default_factory=dict)
    calibrations: dict[str, Calibration] = field(default_factory=dict)
    probabilities: dict[str, Array] = field(default_factory=dict)
    mappings: dict[str, ExpressionMapping] = field(default_factory=dict)


def score(statements: Statements, own: OwnScores) -> Samples:
    """All metrics of an explainer that need no more than its statements."""
    spoken, truth = statements.spoken, statements.truth
    scores = score_motion(statements.said, truth, statements.on_scale)
    return scores | (score_words(spoken, truth) if spoken else {}) | own(statements)


def score_motion(said: Array, truth: Truth, on_scale: Array) -> Samples:
    """The motion metrics of statements ``(N, d)``; ``on_scale`` is the same on the instructor's scale."""
    each = []
    for i, band in enumerate(truth.band):
        instruction = truth.instruction[:, i]
        scores = motion_scores(said[:, i], truth.change[:, i], instruction, band, truth.weights, truth.hard[:, i])
        each.append(
            scores | {"instruction_f1": instruction_f1(on_scale[:, i], instruction, truth.values, truth.weights)}
        )
    return over_numbers(each)


def score_words_alone(said: Array, truth: Truth) -> Samples:
    """``motion_auc_words`` of the expressions ``(N, d)`` of the spoken words."""
    ways = direction(truth.change, np.array(truth.band))
    each = [resampled_motion_auc(*number, truth.weights) for number in zip(said.T, ways.T, strict=True)]
    return over_numbers([{OF_WORDS: values} for values in each])


def over_numbers(each: Sequence[Samples]) -> Samples:
    """The mean of every metric over the numbers; with several numbers also the metrics of each."""
    means = {metric: mean_over_numbers(metric, [one[metric] for one in each]) for metric in each[0]}
    if len(each) == 1:
        return means
    return means | {numbered(metric, i): values for i, one in enumerate(each) for metric, values in one.items()}


def numbered(metric: str, number: int) -> str:
    """The name of a metric of one number."""
    return f"{metric}[{number}]"


def add_loss(samples: Samples, ceiling: Samples) -> None:
    """Add ``vocabulary_loss``: ``motion_auc`` of the predicted change less ``motion_auc_words``; also per number."""
    for metric in [name for name in samples if name.partition("[")[0] == OF_WORDS]:
        most = ceiling[metric.replace(OF_WORDS, "motion_auc")][: len(samples[metric])]
        samples[metric.replace(OF_WORDS, "vocabulary_loss")] = most - samples[metric]


OwnScores = Callable[[Statements], Samples]
"""The scores of metrics of one's own; see ``own_metrics.OwnMetrics``."""


def score_words(spoken: Spoken, truth: Truth) -> Samples:
    """Phrase accuracy of a vocabulary, where the meaning of the words is known."""
    true = {"came_true": (spoken.true, spoken.first_known), "came_true_voted": (spoken.voted_true, spoken.known)}
    return {name: weighted_mean(values, truth.weights * known) for name, (values, known) in true.items()}


def score_confidence(probability: Array, true: Array, truth: Truth, known: Array) -> Samples:
    """The confidence metrics of probabilities ``(N,)`` of a correct prediction, where the meaning is ``known``."""
    weights = truth.weights * known
    return {
        "brier": brier(probability, true, weights),
        "ece": ece(probability, true, weights),
        "risk_at_80": risk_at(probability, true, weights, COVERAGE),
        "risk_all": 1 - weighted_mean(true, weights),
    }


def balance(mapping: Any) -> dict[str, Any]:
    """Balance of a vocabulary's clusters in size and, of numbers, in sign; empty for one without cluster sizes."""
    if not len(getattr(mapping, "sizes", ())):
        return {}
    found = {"size_cv": fixed(size_cv(mapping.sizes)), "size_max": fixed(size_max(mapping.sizes))}
    if moves_of(mapping.meanings) is not None:  # words have no sides
        return found
    columns = [left_right(column) for column in mapping.expressions.T]
    sides = [{"value": list(column), "low": None, "high": None} for column in columns]
    if len(sides) == 1:
        return found | {"left_right": sides[0]}
    return found | {numbered("left_right", number): each for number, each in enumerate(sides)}


def own_columns(names: Iterable[str]) -> list[str]:
    """Those of metrics of one's own, and of words of one's own, each once."""
    return [name for name in dict.fromkeys(names) if name not in (*ROW_METRICS, *IN_EACH_ROW) and "[" not in name]


def laid_out(metrics: dict[str, Any], names: Sequence[str], own: Sequence[str] = ()) -> dict[str, Any]:
    """A row of the report: all metrics in order, then one's ``own``; with several numbers each under ``each``."""
    row: dict[str, Any] = {metric: metrics.get(metric) for metric in (*ROW_METRICS, *own)}
    if len(names) > 1:
        row["each"] = [
            {"number": name} | {metric: metrics.get(numbered(metric, i)) for metric in (*EACH, "left_right")}
            for i, name in enumerate(names)
        ]
    return row


def estimate_json(samples: Array) -> dict[str, float | None]:
    """Value and interval of a metric from its resamples ``(R,)``, rounded to five digits."""
    found = estimate(samples).to_dict()
    return {name: None if number is None else round(number, 5) for name, number in found.items()}


def fixed(value: float) -> dict[str, float | None]:
    """A value that does not depend on resamples, as an estimate without an interval."""
    return {"value": round(float(value), 5), "low": None, "high": None}


def spread_over(values: Iterable[float]) -> dict[str, float | None]:
    """Mean and 95 % range of the values of several refits."""
    known = np.array([value for value in values if not np.isnan(value)])
    if not len(known):
        return dict.fromkeys(("value", "low", "high"))
    low, high = np.quantile(known, [0.025, 0.975])
    return {"value": round(float(known.mean()), 5), "low": round(float(low), 5), "high": round(float(high), 5)}


def difference(one: Samples, other: Samples, metric: str) -> dict[str, float | None] | None:
    """Paired difference ``one`` - ``other`` of a metric, on the same resamples; None if either lacks it."""
    if metric not in one or metric not in other:
        return None
    return estimate_json(one[metric] - other[metric])
