"""Differences of two groups of episodes, paired tests, corrected p-values; the episode is the unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from ibe_rl.metrics.bootstrap import Estimate, estimate
from ibe_rl.types import Array

Groups = tuple[Array, Array]
"""Values ``(A,)`` and ``(B,)`` of two groups of episodes."""


@dataclass(frozen=True)
class Effect:
    """Effect of a first group over a second one.

    Attributes:
        counts: episodes in both.
        means: of both.
        difference: of the means.
        superiority: probability that an episode of the first group has a higher value than one of the second, ties
            counted half (Vargha and Delaney 2000); 0.5 is no difference.
    """

    counts: tuple[int, int]
    means: tuple[float, float]
    difference: Estimate
    superiority: Estimate


def effect(strata: Sequence[Groups], resamples: int = 1000, seed: int = 0) -> Effect | None:
    """Compare two groups within each stratum, with intervals from resampled episodes.

    Args:
        strata: the groups of each stratum. Strata are weighted by their size in the first group for the difference,
            by their number of pairs for the superiority.
        resamples: of the episodes, within each group of each stratum.
        seed: the same values and seed give the same intervals.

    Returns:
        The effect, or None if no stratum has episodes in both groups.
    """
    both = [(np.asarray(first, float), np.asarray(second, float)) for first, second in strata]
    both = [(first, second) for first, second in both if len(first) and len(second)]
    if not both:
        return None
    random = np.random.default_rng(seed)
    drawn = [tuple(_weights(len(group), resamples, random) for group in groups) for groups in both]
    firsts = np.array([len(first) for first, _ in both], float)
    pairs = np.array([len(first) * len(second) for first, second in both], float)
    means = [
        [weights @ group for group, weights in zip(groups, of_each, strict=True)]
        for groups, of_each in zip(both, drawn, strict=True)
    ]
    first_mean, second_mean = (
        np.average([of_each[side] for of_each in means], axis=0, weights=firsts) for side in (0, 1)
    )
    ahead = [_ahead(*groups, *of_each) for groups, of_each in zip(both, drawn, strict=True)]
    return Effect(
        counts=(int(firsts.sum()), sum(len(second) for _, second in both)),
        means=(float(first_mean[0]), float(second_mean[0])),
        difference=estimate(first_mean - second_mean),
        superiority=estimate(np.average(ahead, axis=0, weights=pairs)),
    )


def _weights(count: int, resamples: int, random: np.random.Generator) -> Array:
    """Rows of weights ``(R + 1, count)`` that sum to 1; the first row is uniform."""
    drawn = random.multinomial(count, np.full(count, 1 / count), resamples)
    return np.vstack([np.ones(count), drawn]) / count


def _ahead(first: Array, second: Array, first_weights: Array, second_weights: Array) -> Array:
    """Superiority ``(R,)`` under both rows of weights."""
    wins = (first[:, None] > second) + 0.5 * (first[:, None] == second)
    return np.sum((first_weights @ wins) * second_weights, axis=1)


def paired_p(differences: Array, resamples: int = 10_000, seed: int = 0) -> float:
    """Two-sided p-value of a sign-flip test that paired differences ``(E,)`` have mean 0.

    Raises:
        ValueError: if there are no differences.
    """
    if not len(differences):
        raise ValueError("no episodes: there is no difference to test")
    random = np.random.default_rng(seed)
    return float(
        stats.permutation_test(
            (np.asarray(differences, float),), np.mean, permutation_type="samples", n_resamples=resamples, rng=random
        ).pvalue
    )


def corrected(p_values: Sequence[float]) -> list[float]:
    """P-values corrected for multiple tests under any dependence (Benjamini and Yekutieli 2001)."""
    return stats.false_discovery_control(p_values, method="by").tolist() if p_values else []


def share(successes: Sequence[bool]) -> Estimate:
    """Success rate with Wilson's interval.

    Raises:
        ValueError: if there are no trials.
    """
    if not len(successes):
        raise ValueError("no tries: there is no share of successes")
    test = stats.binomtest(int(np.sum(successes)), len(successes))
    low, high = test.proportion_ci(method="wilson")
    return Estimate(float(np.mean(successes)), float(low), float(high))
