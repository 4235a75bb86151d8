"""The metrics of one explainer on every resample of the episodes, and the row of the report made of them.

Shapes: ``N`` moments, ``d`` numbers in an instruction, ``R`` resamples, row 0 of which is the value itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ibe_rl.evaluation.moments import Moments, Spoken
from ibe_rl.metrics.balance import left_right, size_cv, size_max
from ibe_rl.metrics.bootstrap import estimate, weighted_mean
from ibe_rl.metrics.confidence import Calibration, brier, ece, risk_at
from ibe_rl.metrics.quality import direction, instruction_f1, mean_over_numbers, motion_scores
from ibe_rl.task import Task
from ibe_rl.types import Array, ExpressionMapping

Samples = dict[str, Array]
"""Metric to values ``(R,)``; of an instruction with several numbers also ``metric[i]``, of number i by itself."""

MOTION = ("motion_auc", "motion_auc_disobeyed", "motion_auc_hard", "motion_spearman")
WORDS = ("came_true", "came_true_voted")
CONFIDENCE = ("brier", "ece", "risk_at_80", "risk_all")
BALANCE = ("size_cv", "size_max", "left_right")
ROW_METRICS = (*MOTION, "vocabulary_loss", *WORDS, "instruction_f1", *CONFIDENCE, *BALANCE, "observer_error")
"""The metrics of a row, in the order of the report."""
EACH = (*MOTION, "vocabulary_loss", "instruction_f1")
"""What is told of each number by itself; in the row of all of them stands the mean."""
COVERAGE = 0.8


@dataclass(frozen=True)
class Truth:
    """What really happened over one horizon, and how the moments are weighed.

    Attributes:
        horizon_steps: of the explanations.
        change: ``(N, d)`` real changes of the explained dimensions.
        told: ``(N, d)`` the instruction.
        band: ``d`` of them, see ``Task.explained_band``.
        values: what the instructor can say.
        hard: ``(N, d)`` bool, the state regressor names the wrong way.
        weights: ``(R, N)``.
    """

    horizon_steps: int
    change: Array
    told: Array
    band: tuple[float, ...]
    values: Sequence[float]
    hard: Array
    weights: Array

    @classmethod
    def of(cls, moments: Moments, horizon_steps: int, task: Task, forecast: Array, weights: Array) -> Truth:
        """Of ``moments``, with what a simple ``forecast`` ``(N, d)`` of the changes had said."""
        change = moments.real_change(horizon_steps, task.explained).astype(float)
        band = task.explained_band
        hard = direction(forecast, np.array(band)) != direction(change, np.array(band))
        told = moments.instruction.astype(float)
        return cls(horizon_steps, change, told, band, task.instruction_values, hard, weights)

    def unweighed(self) -> Truth:
        """The same with one row of equal weights: for values without an interval."""
        return replace(self, weights=self.weights[:1])


@dataclass
class Judged:
    """What came out at one horizon.

    Attributes:
        truth: what really happened.
        names: of the numbers of an instruction.
        samples: explainer to its metrics on every resample.
        refits: explainer to the metrics of each of its vocabularies, without resamples.
        spoken: explainer to what its vocabulary said.
        calibrations: explainer to how its confidence is made.
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


def score_motion(said: Array, truth: Truth, on_scale: Array) -> Samples:
    """How well what was said ``(N, d)`` tells the motion; ``on_scale`` is the same on the instructor's scale."""
    each = []
    for i, band in enumerate(truth.band):
        told = truth.told[:, i]
        scores = motion_scores(said[:, i], truth.change[:, i], told, band, truth.weights, truth.hard[:, i])
        each.append(scores | {"instruction_f1": instruction_f1(on_scale[:, i], told, truth.values, truth.weights)})
    return over_numbers(each)


def over_numbers(each: Sequence[Samples]) -> Samples:
    """The mean of every metric over the numbers, and with several of them each number by itself."""
    means = {metric: mean_over_numbers(metric, [one[metric] for one in each]) for metric in each[0]}
    if len(each) == 1:
        return means
    return means | {numbered(metric, i): values for i, one in enumerate(each) for metric, values in one.items()}


def numbered(metric: str, number: int) -> str:
    """What a metric of one number by itself is called."""
    return f"{metric}[{number}]"


def add_loss(samples: Samples, ceiling: Samples) -> None:
    """Add ``vocabulary_loss``, what ``motion_auc`` lacks to that of the predicted change; also of each number."""
    for metric in [name for name in samples if name.partition("[")[0] == "motion_auc"]:
        most = ceiling[metric][: len(samples[metric])]
        samples[metric.replace("motion_auc", "vocabulary_loss")] = most - samples[metric]


def score_words(spoken: Spoken, truth: Truth) -> Samples:
    """Whether it went as the words of a vocabulary predict, where their meaning is known."""
    true = {"came_true": (spoken.true, spoken.first_known), "came_true_voted": (spoken.voted_true, spoken.known)}
    return {name: weighted_mean(values, truth.weights * known) for name, (values, known) in true.items()}


def score_confidence(probability: Array, true: Array, truth: Truth, known: Array) -> Samples:
    """Whether the confidence ``(N,)`` that it goes as predicted is worth anything, where the meaning is ``known``."""
    weights = truth.weights * known
    return {
        "brier": brier(probability, true, weights),
        "ece": ece(probability, true, weights),
        "risk_at_80": risk_at(probability, true, weights, COVERAGE),
        "risk_all": 1 - weighted_mean(true, weights),
    }


def balance(mapping: Any) -> dict[str, Any]:
    """How a vocabulary's clusters share the windows and the scale; empty for one that does not tell its sizes."""
    if not len(getattr(mapping, "sizes", ())):
        return {}
    told = {"size_cv": fixed(size_cv(mapping.sizes)), "size_max": fixed(size_max(mapping.sizes))}
    columns = [left_right(column) for column in mapping.expressions.T]
    sides = [{"value": list(column), "low": None, "high": None} for column in columns]
    if len(sides) == 1:
        return told | {"left_right": sides[0]}
    return told | {numbered("left_right", number): each for number, each in enumerate(sides)}


def laid_out(told: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """What a row says: all metrics in their order, and under ``each`` those of every number by its name, if several."""
    row: dict[str, Any] = {metric: told.get(metric) for metric in ROW_METRICS}
    if len(names) > 1:
        row["each"] = [
            {"number": name} | {metric: told.get(numbered(metric, i)) for metric in (*EACH, "left_right")}
            for i, name in enumerate(names)
        ]
    return row


def estimate_json(samples: Array) -> dict[str, float | None]:
    """Value and interval of a metric on all resamples ``(R,)`` for a report, rounded to five digits."""
    told = estimate(samples).to_dict()
    return {name: None if number is None else round(number, 5) for name, number in told.items()}


def fixed(value: float) -> dict[str, float | None]:
    """A value that no resampling of episodes changes."""
    return {"value": round(float(value), 5), "low": None, "high": None}


def spread_over(values: Iterable[float]) -> dict[str, float | None]:
    """Mean of what several refits gave, and the range that holds 95 % of them."""
    known = np.array([value for value in values if not np.isnan(value)])
    if not len(known):
        return dict.fromkeys(("value", "low", "high"))
    low, high = np.quantile(known, [0.025, 0.975])
    return {"value": round(float(known.mean()), 5), "low": round(float(low), 5), "high": round(float(high), 5)}


def difference(one: Samples, other: Samples, metric: str) -> dict[str, float | None] | None:
    """By how much ``one`` has more of a metric, on the same moments and resamples; None if either lacks it."""
    if metric not in one or metric not in other:
        return None
    return estimate_json(one[metric] - other[metric])
