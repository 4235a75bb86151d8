"""Bootstrap over whole episodes: a score on many resamples, and its interval.

Windows overlap, so the moments of one episode are not independent; episodes are. A resample is a row of weights, one
for each moment. Row 0 has equal weights and gives the point estimate. Paired comparisons use the same rows.

Shapes: ``N`` moments, ``R`` rows of weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from ibe_rl.types import Array

CHUNK = 200_000
"""Weights processed together: they fit the processor's cache, which is more than twice as fast."""


@dataclass(frozen=True)
class Estimate:
    """A value with its interval, NaN where undefined."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float | None]:
        """For JSON, with None in place of NaN."""
        return {name: None if math.isnan(number) else number for name, number in asdict(self).items()}


def estimate(rows: Array, level: float = 0.95) -> Estimate:
    """Row 0 of ``(R,)`` with the percentile interval of the other rows, ignoring NaN."""
    value, resampled = float(rows[0]), rows[1:][~np.isnan(rows[1:])]
    if math.isnan(value) or not len(resampled):
        return Estimate(value, math.nan, math.nan)
    low, high = np.quantile(resampled, [(1 - level) / 2, (1 + level) / 2])
    return Estimate(value, float(low), float(high))


def episode_weights(episode: Array, resamples: int = 1000, seed: int = 0) -> Array:
    """Resample the episodes with replacement.

    Args:
        episode: ``(N,)`` the episode of each moment, any integers.
        resamples: number of resamples, in addition to row 0.
        seed: the same episodes and seed give the same weights.

    Returns:
        ``(resamples + 1, N)`` float32: row 0 is 1, the others count the draws of the moment's episode.

    Raises:
        ValueError: if there is no moment.
    """
    if not len(episode):
        raise ValueError("no moments: there is no episode to draw")
    names, column = np.unique(episode, return_inverse=True)
    count = len(names)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), resamples)
    return np.vstack([np.ones((1, count)), drawn]).astype(np.float32)[:, column]


def weighted_mean(values: Array, weights: Array) -> Array:
    """Mean of ``(N,)`` under each row of weights ``(R, N)``; NaN where these are 0."""
    return ratio(weights @ np.asarray(values, float), weights.sum(axis=1, dtype=float))


def weighted_auc(score: Array, positive: Array, weights: Array) -> Array:
    """AUC: share of pairs of a positive and a negative moment that a score ranks correctly; ties count half.

    Args:
        score: ``(N,)``.
        positive: ``(N,)`` bool.
        weights: ``(R, N)``.

    Returns:
        ``(R,)``, NaN where the positives or the negatives have no weight.

    Raises:
        ValueError: if a score is NaN.
    """
    ties = Ties.of(score)

    def auc(part: Array) -> Array:
        ahead = ties.sums(part * positive)
        others = ties.sums(part) - ahead
        right = np.sum(ahead * _middle(others), axis=1)
        return ratio(right, ahead.sum(axis=1) * others.sum(axis=1))

    return by_chunks(auc, weights)


def weighted_spearman(a: Array, b: Array, weights: Array) -> Array:
    """Rank correlation of ``a`` ``(N,)`` and ``b`` ``(N,)`` under each row of weights ``(R, N)``; ties share a rank.

    Returns:
        ``(R,)``, NaN where one of the two is constant.

    Raises:
        ValueError: if a value is NaN.
    """
    both = [Ties.of(values) for values in (a, b)]

    def spearman(part: Array) -> Array:
        products, scale = part.copy(), np.ones(len(part))
        for ties in both:
            sums = ties.sums(part)
            ranks = _middle(sums) - sums.sum(axis=1, keepdims=True) / 2  # half of all weights: the mean rank
            products *= ranks[:, ties.group]
            scale *= np.sqrt(np.sum(sums * ranks**2, axis=1))
        return ratio(products.sum(axis=1), scale)  # of a constant the ranks and so the scale are exactly 0

    return by_chunks(spearman, weights)


def weighted_f1(predicted: Array, true: Array, classes: int, weights: Array) -> Array:
    """Macro-F1 ``(R,)`` of predicted classes ``(N,)`` against true ones ``(N,)``, both from 0 to ``classes`` - 1.

    As scikit-learn's ``f1_score``: classes that neither occur nor are predicted in a resample are left out.
    """

    def f1(part: Array) -> Array:
        pairs = [(predicted == one, true == one) for one in range(classes)]
        hits = [part @ (said & real) for said, real in pairs]
        counts = [part @ (said.astype(float) + real) for said, real in pairs]
        return np.nanmean([ratio(2 * hit, count) for hit, count in zip(hits, counts, strict=True)], axis=0)

    return by_chunks(f1, weights)


@dataclass(frozen=True)
class Ties:
    """Moments with the same value, lowest value first.

    Attributes:
        group: ``(N,)`` the number of each moment's value among the ``G`` distinct ones.
        order: ``(N,)`` the moments sorted by value.
        starts: ``(G,)`` where in ``order`` each value begins.
    """

    group: Array
    order: Array
    starts: Array

    @classmethod
    def of(cls, values: Array) -> Ties:
        """Group values ``(N,)``.

        Raises:
            ValueError: if one is NaN, which cannot be ranked.
        """
        if np.isnan(values).any():
            raise ValueError("nan has no rank: every value must be a number")
        _, group = np.unique(values, return_inverse=True)
        order = np.argsort(group, kind="stable")
        return cls(group, order, np.flatnonzero(np.diff(group[order], prepend=-1)))

    def sums(self, weights: Array) -> Array:
        """Sum weights ``(R, N)`` over moments with the same value, to ``(R, G)``."""
        return np.add.reduceat(weights[:, self.order], self.starts, axis=1, dtype=float)


def by_chunks(score: Callable[[Array], Array], weights: Array) -> Array:
    """Apply ``score``, from ``(r, N)`` float64 weights to ``(r,)``, to a few rows at a time."""
    rows = max(1, CHUNK // max(1, weights.shape[1]))
    return np.concatenate([score(weights[i : i + rows].astype(float)) for i in range(0, len(weights), rows)])


def _middle(sums: Array) -> Array:
    """Mid-ranks: the weight below each of ``(R, G)`` ascending values plus half its own."""
    return np.cumsum(sums, axis=1) - sums / 2


def ratio(part: Array, whole: Array, of_nothing: float = math.nan) -> Array:
    """Divide, with ``of_nothing`` where ``whole`` is 0."""
    return np.divide(part, whole, out=np.full(whole.shape, of_nothing), where=whole > 0)
