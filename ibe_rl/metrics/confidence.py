"""Calibration of the confidence: Brier score, calibration error, risk at a coverage, and the calibration itself.

Shapes: ``N`` moments, ``R`` rows of weights (see ``bootstrap.episode_weights``), ``F`` features.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.special import expit, logit
from sklearn.linear_model import LogisticRegression

from ibe_rl.metrics.bootstrap import Ties, by_chunks, ratio, weighted_mean
from ibe_rl.types import Array, read_only


def brier(confidence: Array, true: Array, weights: Array) -> Array:
    """Brier score: mean squared error of confidences; 0 is perfect, .25 is a constant one half.

    Args:
        confidence: ``(N,)`` in [0, 1].
        true: ``(N,)`` bool, whether it went as predicted.
        weights: ``(R, N)``.

    Returns:
        ``(R,)``, NaN where the weights are 0.

    Raises:
        ValueError: if a confidence is outside [0, 1].
    """
    return weighted_mean((_checked(confidence) - true) ** 2, weights)


def ece(confidence: Array, true: Array, weights: Array, bins: int = 10) -> Array:
    """Expected calibration error: distance of mean confidence from accuracy, over bins.

    The bins divide [0, 1] evenly and include their lower end, the last one also 1. Each counts with its weight.
    Arguments, result and errors as in ``brier``.
    """
    bin_of = np.minimum((_checked(confidence) * bins).astype(int), bins - 1)
    gaps = weights @ ((confidence - true)[:, None] * np.eye(bins)[bin_of])
    return ratio(np.abs(gaps).sum(axis=1), weights.sum(axis=1, dtype=float))


def risk_at(confidence: Array, true: Array, weights: Array, share: float = 0.8) -> Array:
    """Error rate among the ``share`` most confident moments; with ``share`` 1, among all.

    Where the cutoff falls among equally confident moments, all of them count with the same fraction: the expected
    value of a random choice among them.

    Args:
        confidence: ``(N,)``; only its order counts.
        true: ``(N,)`` bool.
        weights: ``(R, N)``.
        share: above 0, at most 1, of the weight of each row.

    Returns:
        ``(R,)``, NaN where the weights are 0.

    Raises:
        ValueError: if a confidence is NaN, or ``share`` not in (0, 1].
    """
    if not 0 < share <= 1:
        raise ValueError(f"share={share}: allowed is above 0 and at most 1")
    ties = Ties.of(-np.asarray(confidence))

    def risk(part: Array) -> Array:
        all_of, false_of = ties.sums(part), ties.sums(part * ~np.asarray(true, bool))
        wanted = share * part.sum(axis=1, keepdims=True)
        kept = np.clip(wanted - (np.cumsum(all_of, axis=1) - all_of), 0, all_of)
        return ratio((kept * ratio(false_of, all_of, of_nothing=0.0)).sum(axis=1), wanted[:, 0])

    return by_chunks(risk, weights)


def risk_coverage(confidence: Array, true: Array) -> tuple[Array, Array]:
    """The curve of risk against coverage, from only the most confident moments to all.

    Args:
        confidence: ``(N,)``.
        true: ``(N,)`` bool.

    Returns:
        For each of the ``G`` distinct confidences, descending: the share ``(G,)`` of moments that are at least as
        confident, and the error rate ``(G,)`` among these.

    Raises:
        ValueError: if a confidence is NaN.
    """
    ties, ones = Ties.of(-np.asarray(confidence)), np.ones((1, len(confidence)))
    spoken, false = (np.cumsum(ties.sums(part)[0]) for part in (ones, ones * ~np.asarray(true, bool)))
    return spoken / len(confidence), false / spoken


EDGE = 0.02
"""Keeps the log-odds of 0 and 1 finite: about 4 in size, those of 1 in 50."""


@dataclass(frozen=True)
class Calibration:
    """Logistic regression from features of a moment to the probability that its explanation comes true.

    Features are shares, in [0, 1], and the regression is on their log-odds: where three of four futures agree, about
    three of four such explanations come true. On the shares themselves the low ones get too little (docs/LOG.md).

    Attributes:
        names: ``F`` names of the features.
        mean: ``(F,)`` subtracted from the features.
        scale: ``(F,)`` divisor after that, above 0.
        coefficients: ``(F,)``.
        intercept: ``(1,)``.
        log_odds: whether it is on the log-odds; False: on the features as they are, as in earlier runs.
    """

    names: tuple[str, ...]
    mean: Array
    scale: Array
    coefficients: Array
    intercept: Array
    log_odds: bool = False

    def __post_init__(self) -> None:
        sizes = {"mean": len(self.names), "scale": len(self.names), "coefficients": len(self.names), "intercept": 1}
        for name, size in sizes.items():
            values = read_only(np.array(getattr(self, name), float), (size,), f"Calibration.{name}")
            if not np.isfinite(values).all() or (name == "scale" and not (values > 0).all()):
                raise ValueError(
                    f"Calibration.{name} has {values.tolist()}: allowed are finite numbers, scales above 0"
                )
            object.__setattr__(self, name, values)

    @classmethod
    def fit(cls, features: Array, true: Array, names: Sequence[str]) -> Self:
        """Fit to moments with known outcomes.

        Args:
            features: ``(N, F)`` in [0, 1].
            true: ``(N,)`` bool; if all are equal, the probability is the constant (n + 1) / (N + 2), smoothed from
                the n true ones.
            names: ``F`` names.

        Raises:
            ValueError: if a feature is not in [0, 1], or the number of names is not that of the features.
        """
        size, n_true = features.shape[1], int(np.sum(true))
        features = _log_odds(_checked(features, "a feature of the confidence is ", rounding=1e-6))
        if n_true in (0, len(true)):
            share = logit((n_true + 1) / (len(true) + 2))
            return cls(tuple(names), np.zeros(size), np.ones(size), np.zeros(size), np.array([share]), log_odds=True)
        mean = features.mean(axis=0)
        scale = np.where(np.ptp(features, axis=0) > 0, features.std(axis=0), 1.0)
        model = LogisticRegression().fit((features - mean) / scale, np.asarray(true, bool))
        return cls(tuple(names), mean, scale, model.coef_[0], model.intercept_, log_odds=True)

    def probability(self, features: Array) -> Array:
        """Features ``(N, F)``, in the order of ``names``, to probabilities ``(N,)``."""
        features = _log_odds(features) if self.log_odds else features
        return expit((features - self.mean) / self.scale @ self.coefficients + self.intercept)

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        return {name: np.asarray(getattr(self, name)).tolist() for name in self.__dataclass_fields__}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``.

        Raises:
            ValueError: if a value is missing, not a number, or of the wrong shape.
        """
        try:
            names, log_odds = tuple(str(name) for name in values["names"]), values.get("log_odds", False)
            if not isinstance(log_odds, bool):
                raise ValueError(f"log_odds={log_odds!r}: allowed are true and false")
            numbers = {name: values[name] for name in cls.__dataclass_fields__ if name not in ("names", "log_odds")}
            return cls(names, **numbers, log_odds=log_odds)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"the calibration is damaged: {error!r}") from None


def _log_odds(shares: Array) -> Array:
    return logit((np.clip(shares, 0, 1) + EDGE) / (1 + 2 * EDGE))  # a sum of shares can be 1 and a rounding


def _checked(confidence: Array, what: str = "confidence=", rounding: float = 0.0) -> Array:
    outside = ~((confidence >= -rounding) & (confidence <= 1 + rounding))  # NaN is outside too
    if outside.any():
        raise ValueError(f"{what}{confidence[outside][0]}: allowed is 0 to 1")
    return confidence
