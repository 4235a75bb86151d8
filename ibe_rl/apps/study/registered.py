"""The registered test: a permutation test over persons, crossed with episodes, and its interval.

The unit is a person. From each loss the mean of its episode over both arms is taken away, so that hard episodes do not
count as differences between people. This mean knows no arm, so the test stays exact. An episode that was seen under one
arm only tells nothing about the arms then; where most are like that, the difference is understated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ibe_rl.metrics.bootstrap import Estimate, estimate, ratio
from ibe_rl.types import Array

MOST_BOOTSTRAPS = 10_000
_BATCH = 10_000
_ROUNDING = 1e-9


@dataclass(frozen=True)
class TwoArms:
    """What people answered under two arms: ``P`` people, ``E`` episodes.

    Attributes:
        arms: the first one is expected to err less.
        loss: ``(P, E)`` in percent, NaN where not seen.
        first: ``(P, E)`` whether it was seen under the first arm.
        paired: every person has both arms; people who have one of them are left out.
    """

    arms: tuple[str, str]
    loss: Array
    first: Array
    paired: bool

    @classmethod
    def of(cls, trials: pd.DataFrame, arms: tuple[str, str]) -> TwoArms:
        """Take two arms out of trials that count."""
        arm = trials["arm"].to_numpy()
        used = trials[(arm == arms[0]) | (arm == arms[1])]
        people, row = np.unique(used["person"].to_numpy(int), return_inverse=True)
        episodes, column = np.unique(used["episode"].to_numpy(int), return_inverse=True)
        loss = np.full((len(people), len(episodes)), np.nan)
        first = np.zeros(loss.shape, bool)
        loss[row, column] = used["loss"].to_numpy(float)
        first[row, column] = used["arm"].to_numpy() == arms[0]
        both = first.any(axis=1) & (~first & ~np.isnan(loss)).any(axis=1)
        if both.any():
            loss, first = loss[both], first[both]
        return cls(arms, loss, first, bool(both.any()))

    @property
    def second(self) -> Array:
        """``(P, E)`` whether it was seen under the second arm."""
        return ~self.first & ~np.isnan(self.loss)

    @property
    def counts(self) -> tuple[int, int]:
        """People of each arm."""
        return int(self.first.any(axis=1).sum()), int(self.second.any(axis=1).sum())

    @property
    def episodes_of_both(self) -> int:
        """Episodes that were seen under both arms."""
        return int((self.first.any(axis=0) & self.second.any(axis=0)).sum())

    @property
    def enough(self) -> bool:
        """Whether there is anything to compare: two people of each arm, or two with both."""
        return min(self.counts) >= 2

    def centred(self) -> Array:
        """Losses ``(P, E)`` minus the mean of their episode, 0 where not seen."""
        seen = ~np.isnan(self.loss)
        values = np.where(seen, self.loss, 0.0)
        return np.where(seen, values - ratio(values.sum(axis=0), seen.sum(axis=0).astype(float)), 0.0)

    def person_means(self, centred: bool = True) -> tuple[Array, Array]:
        """Mean loss of each person ``(A,)`` under the first and ``(B,)`` under the second arm."""
        values = self.centred() if centred else np.nan_to_num(self.loss)
        first, second = (
            ratio((values * seen).sum(axis=1), seen.sum(axis=1).astype(float)) for seen in (self.first, self.second)
        )
        return first[~np.isnan(first)], second[~np.isnan(second)]


def permutation_p(two: TwoArms, resamples: int, seed: int = 0) -> float:
    """Two-sided p-value that the arms do not differ; exact where all permutations are no more than ``resamples``.

    With both arms in a person, the sign of each person's difference is flipped; otherwise arms are shuffled between
    persons. 1 if there are too few people.
    """
    if not two.enough:
        return 1.0
    first, second = two.person_means()
    if two.paired:
        return flip_p(first - second, resamples, seed)
    values = np.concatenate([first, second])
    return _p_value(values, len(first), resamples, seed)


def flip_p(differences: Array, resamples: int, seed: int = 0) -> float:
    """Two-sided p-value that differences ``(N,)`` have mean 0, by flips of their signs."""
    return _p_value(differences, None, resamples, seed)


def _p_value(values: Array, first: int | None, resamples: int, seed: int) -> float:
    """Share of permutations that are as extreme as what was seen; of drawn ones, with what was seen among them."""
    count = len(values)
    possible = 2**count if first is None else math.comb(count, first)
    seen = values.mean() if first is None else values[:first].mean() - values[first:].mean()
    least = abs(seen) * (1 - _ROUNDING)
    exact = possible <= resamples
    sizes = [possible] if exact else [min(_BATCH, resamples - begun) for begun in range(0, resamples, _BATCH)]
    rows = (_permutations(count, first, size, exact, seed + at) for at, size in enumerate(sizes))
    hits = sum(int(np.sum(np.abs(each @ values) >= least)) for each in rows)
    return hits / possible if exact else (hits + 1) / (resamples + 1)


@lru_cache(maxsize=32)
def _permutations(count: int, first: int | None, size: int, exact: bool, seed: int) -> Array:
    """Weights ``(size, count)`` of the values: all permutations or drawn ones. Tests of as many people share them."""
    random = np.random.default_rng(seed)
    if first is None:
        every = np.arange(size)[:, None] >> np.arange(count) & 1
        return (2.0 * (every if exact else random.integers(2, size=(size, count))) - 1) / count
    weights = np.full((size, count), -1 / (count - first))
    if exact:
        members = np.array(list(combinations(range(count), first)))
        np.put_along_axis(weights, members, 1 / first, axis=1)
        return weights
    weights[:, :first] = 1 / first
    return random.permuted(weights, axis=1)


def crossed_interval(two: TwoArms, resamples: int, seed: int = 0) -> Estimate:
    """The difference of the arms with a 95 % percentile interval.

    Persons and episodes are drawn again, each by itself. This counts the noise of single answers more than once, so
    the interval is rather too wide than too narrow.
    """
    random = np.random.default_rng(seed)
    rows = min(resamples, MOST_BOOTSTRAPS)
    people, episodes = two.loss.shape
    drawn = _weights(random, rows, episodes)
    means = [_weighted_means(two.centred(), seen, drawn) for seen in (two.first, two.second)]
    if two.paired:
        weights = [_weights(random, rows, people)] * 2
    else:
        weights = [_group_weights(random, rows, np.any(seen, axis=1)) for seen in (two.first, two.second)]
    first, second = (_average(mean, weight) for mean, weight in zip(means, weights, strict=True))
    return estimate(first - second)


def _weights(random: np.random.Generator, rows: int, count: int) -> Array:
    """Row 0 is 1; the others count how often each is drawn."""
    return np.vstack([np.ones(count), random.multinomial(count, np.full(count, 1 / count), rows)])


def _group_weights(random: np.random.Generator, rows: int, members: Any) -> Array:
    weights = np.zeros((rows + 1, len(members)))
    weights[:, members] = _weights(random, rows, int(members.sum()))
    return weights


def _weighted_means(values: Array, seen: Array, weights: Array) -> Array:
    """Each person's mean ``(R, P)`` under weights of the episodes; NaN for who saw none of them."""
    return ratio(weights @ (values * seen).T, weights @ seen.T.astype(float))


def _average(means: Array, weights: Array) -> Array:
    known = ~np.isnan(means)
    return ratio((np.nan_to_num(means) * weights * known).sum(axis=1), (weights * known).sum(axis=1))


def effect_size(two: TwoArms, resamples: int, seed: int = 0) -> Estimate:
    """The difference in standard deviations of persons: Hedges' g, or of the paired differences, both without bias.

    The interval is a percentile bootstrap over persons. Below 0 the first arm errs less.
    """
    random = np.random.default_rng(seed)
    rows = min(resamples, MOST_BOOTSTRAPS)
    groups = two.person_means()
    if two.paired:
        groups = (groups[0] - groups[1], np.zeros(1))
    moments = [_moments(group, _weights(random, rows, len(group))) for group in groups]
    degrees = sum(len(group) - 1 for group in groups)
    spread = sum(squares for _, squares in moments) / degrees
    small = 1 - 3 / (4 * degrees - 1)
    return estimate(small * ratio(moments[0][0] - moments[1][0], np.sqrt(spread)))


def _moments(group: Array, weights: Array) -> tuple[Array, Array]:
    """Mean and sum of squared deviations under each row of weights."""
    means = weights @ group / len(group)
    return means, np.maximum(weights @ group**2 - len(group) * means**2, 0.0)


def compared(trials: pd.DataFrame, arms: tuple[str, str], resamples: int, seed: int = 0) -> dict[str, Any]:
    """Compare two arms.

    Args:
        trials: that count, of people who count.
        arms: the first one is expected to err less.
        resamples: of persons and episodes.
        seed: the same trials and seed give the same numbers.

    Returns:
        For JSON; ``p`` and the estimates are None if there are too few people.
    """
    two = TwoArms.of(trials, arms)
    found: dict[str, Any] = {
        "arms": list(arms),
        "paired": two.paired,
        "people": list(two.counts),
        "episodes": two.loss.shape[1],
        "episodes_of_both": two.episodes_of_both,
    }
    if not two.enough:
        return {**found, **dict.fromkeys(("means", "difference", "effect", "p", "p_episodes"))}
    return {
        **found,
        "means": [float(np.mean(group)) for group in two.person_means(centred=False)],
        "difference": crossed_interval(two, resamples, seed).to_dict(),
        "effect": effect_size(two, resamples, seed).to_dict(),
        "p": permutation_p(two, resamples, seed),
        "p_episodes": _over_episodes(two, resamples, seed),
    }


def _over_episodes(two: TwoArms, resamples: int, seed: int) -> float | None:
    """The same question with episodes as the unit: would other episodes show it too?"""
    values = np.nan_to_num(two.loss)
    means = [ratio((values * seen).sum(axis=0), seen.sum(axis=0).astype(float)) for seen in (two.first, two.second)]
    differences = (means[0] - means[1])[~np.isnan(means[0] - means[1])]
    return flip_p(differences, resamples, seed) if len(differences) > 1 else None
