"""Sources of evidence for the sign of an instruction, each with a bootstrap confidence interval over episodes.

All of them take ``log``, the steps of good and bad episodes; ``axis`` ``(S,)``, along which a movement is measured in
standard deviations; ``number``, the index into the instruction; and ``seed``, of the resampling. They return None if
too few episodes carry the effect.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata

from ibe_rl.ibe.delta import LoggedSteps
from ibe_rl.ibe.meaning import Evidence
from ibe_rl.types import Array

RESAMPLES, INTERVAL_PERCENTILES = 400, (0.5, 99.5)
"""99 %: dozens of logs are judged by several sources each, and 95 % would err too often."""
POSITION_BINS = 10
REGRESSION_STEPS, MAX_QUADRATIC_DIMENSIONS = 2_500, 12
"""Most steps that a regression on the state is fitted on; with more dimensions it has no squares and products."""
MIN_EPISODES, MIN_TOLD_WINDOWS = 8, 5
"""Fewer episodes are no evidence; an episode with fewer windows does not count as instructed."""
NEGLIGIBLE = 1e-6
"""Smaller differences than this share of a quantity are none: states are kept in single precision."""


def satisfaction(log: LoggedSteps, axis: Array, number: int, seed: int) -> Evidence | None:
    """After which movement the instructor stops asking for it.

    The regression slope of the movement on the decrease of the instruction within the window, for a decrease of 1.
    Windows are only compared if they begin with the same instruction at a similar position. It needs neither a reward
    nor an agent that obeys. The sign is reversed for an instructor who asks for what is happening anyway ("push with
    the swing").
    """
    signs, last = log.signs(number), log.last_heard(number)
    position = log.states @ axis
    rows = np.flatnonzero(last > np.arange(len(log)))
    moved, decrease = (position[last] - position)[rows] / _scale(log, axis), (signs - signs[last])[rows]
    bins = _bins(position[rows], signs[rows])
    moved, decrease = _without_means(moved, bins), _without_means(decrease, bins)
    changed = np.unique(log.episode[rows[decrease > 0]])
    weights = _resamples(log.episode_count, seed)
    sums = [np.bincount(log.episode[rows], each, log.episode_count) for each in (moved * decrease, decrease**2)]
    covariance, variance = (weights @ each for each in sums)
    return _evidence("satisfaction", _ratio(covariance, variance, above=1e-9), len(changed))


def compliance(log: LoggedSteps, axis: Array, number: int, among: Array, seed: int) -> Evidence | None:
    """How far episodes moved the instructed way, averaged over windows ("best", the paper's source).

    ``among`` ``(E,)`` bool are the episodes that count.
    """
    signs = log.signs(number)
    rows = (signs != 0) & among[log.episode]
    if not rows.any():
        return None
    means = _means(log, _moved(log, axis) * signs, [rows], seed)
    return _evidence("best", means[:, 0], _episodes(log, rows))


def pays(log: LoggedSteps, axis: Array, number: int, seed: int) -> Evidence | None:
    """Whether episodes that follow the instruction more earn more.

    The rank correlation, within each context, of the total reward with the mean movement the instructed way.
    """
    signs = log.signs(number)
    windows = np.bincount(log.episode[signs != 0], minlength=log.episode_count)
    moved = np.bincount(log.episode, _moved(log, axis) * signs, log.episode_count)
    counted = windows >= MIN_TOLD_WINDOWS
    followed = np.divide(moved, windows, out=np.zeros(log.episode_count), where=counted)
    first, second = (_ranks_within(values, log.contexts, counted)[counted] for values in (followed, log.returns))
    if counted.sum() < MIN_EPISODES or min(np.ptp(first), np.ptp(second)) == 0:
        return None
    return _evidence("pays", _correlation(first, second, np.arange(len(first)), len(first), seed), len(first))


def pays_at_once(log: LoggedSteps, axis: Array, number: int, seed: int) -> Evidence | None:
    """Whether windows earn more in which the agent follows the instruction more than expected.

    The partial correlation of movement and reward: what a regression on the state and the instruction predicts is
    taken off both. None if all windows earn the same, as with a constant reward for each step, or if the regression
    leaves nothing but rounding, where movement or reward follows from the state.
    """
    signs = log.signs(number)
    rows = np.flatnonzero((signs != 0) & log.complete)
    earned = log.window_return[rows]
    if len(rows) < MIN_TOLD_WINDOWS or np.ptp(earned) <= NEGLIGIBLE * max(1.0, float(np.abs(earned).max())):
        return None
    columns, both = _regressors(log.states[rows], signs[rows]), np.column_stack([_moved(log, axis)[rows], earned])
    left = _residuals(columns, both)
    if (left.std(axis=0) <= NEGLIGIBLE * both.std(axis=0)).any():
        return None
    moved, earned = left.T
    correlation = _correlation(moved * signs[rows], earned, log.episode[rows], log.episode_count, seed)
    return _evidence("pays_at_once", correlation, _episodes(log, rows))


def influence(log: LoggedSteps, axis: Array, up: Array, down: Array, seed: int) -> Evidence | None:
    """How the agent's movement differs between the instructions +1 and -1 in the same state.

    ``up`` and ``down`` ``(M, S)`` are its changes of the state, from ``M`` states of different episodes.
    """
    if len(up) < MIN_EPISODES:
        return None
    differs = (up - down) @ axis / (2 * _scale(log, axis))
    return _evidence("influence", (_resamples(len(up), seed) @ differs) / len(up), len(up))


def influence_of_plan(log: LoggedSteps, axis: Array, number: int, seed: int) -> Evidence | None:
    """The same from the log alone, where the instruction does not depend on the state, as if randomised.

    Only odd episodes are read: the axis was fitted on the even ones.
    """
    signs = log.signs(number) * (log.episode % 2)
    groups = [signs == 1, signs == -1]
    if not groups[0].any() or not groups[1].any():
        return None
    means = _means(log, _moved(log, axis), groups, seed)
    return _evidence("influence", (means[:, 0] - means[:, 1]) / 2, _episodes(log, signs != 0))


def _evidence(source: str, resampled: Array, episodes: int) -> Evidence | None:
    """From the effect on every resample, the sample itself first; None if it is not defined on most of them."""
    defined = resampled[~np.isnan(resampled)]
    if episodes < MIN_EPISODES or np.isnan(resampled[0]) or len(defined) < len(resampled) / 2:
        return None
    low, high = np.percentile(defined, INTERVAL_PERCENTILES)
    return Evidence(source, float(resampled[0]), float(low), float(high), episodes)


def _resamples(count: int, seed: int) -> Array:
    """Bootstrap weights ``(R, count)``: how often each is drawn; the first row is the sample itself."""
    weights = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), RESAMPLES)
    weights[0] = 1
    return weights


def _means(log: LoggedSteps, values: Array, groups: list[Array], seed: int) -> Array:
    """Mean of values ``(N,)`` over each group of rows, ``(R, G)`` on every resample of whole episodes."""
    weights = _resamples(log.episode_count, seed)
    sums = [np.bincount(log.episode[rows], values[rows], log.episode_count) for rows in groups]
    counts = [np.bincount(log.episode[rows], minlength=log.episode_count) for rows in groups]
    return _ratio(weights @ np.stack(sums, axis=1), weights @ np.stack(counts, axis=1))


def _correlation(first: Array, second: Array, episode: Array, count: int, seed: int) -> Array:
    """Of two centred columns ``(N,)``, on every resample ``(R,)`` of episodes; nan where one is constant."""
    weights = _resamples(count, seed)
    squares = [weights @ np.bincount(episode, values**2, count) for values in (first, second)]
    return _ratio(weights @ np.bincount(episode, first * second, count), np.sqrt(squares[0] * squares[1]))


def _ratio(dividend: Array, divisor: Array, above: float = 0.0) -> Array:
    """The quotient, nan where the divisor is too small."""
    return np.divide(dividend, divisor, out=np.full(dividend.shape, np.nan), where=divisor > above)


def _scale(log: LoggedSteps, axis: Array) -> float:
    return float(np.std(log.delta @ axis)) or 1.0


def _moved(log: LoggedSteps, axis: Array) -> Array:
    moved: Array = log.delta @ axis / _scale(log, axis)
    return moved


def _episodes(log: LoggedSteps, rows: Array) -> int:
    return len(np.unique(log.episode[rows]))


def _regressors(states: Array, signs: Array) -> Array:
    """The state for each sign of the instruction, and its squares and products."""
    spread = states.std(axis=0)
    standard = (states - states.mean(axis=0)) / np.where(spread > 0, spread, 1)
    linear = np.column_stack([np.ones(len(states)), standard])
    by_sign = [linear * (signs == sign)[:, None] for sign in (-1, 1)]
    if states.shape[1] > MAX_QUADRATIC_DIMENSIONS:
        return np.concatenate(by_sign, axis=1)
    first, second = np.triu_indices(states.shape[1])
    return np.concatenate([*by_sign, standard[:, first] * standard[:, second]], axis=1)


def _residuals(columns: Array, values: Array) -> Array:
    """Of a regression of the values ``(N, 2)``, fitted on a subset of the rows."""
    some = slice(None, None, max(1, len(columns) // REGRESSION_STEPS))
    left: Array = values - columns @ np.linalg.lstsq(columns[some], values[some], rcond=1e-6)[0]
    return left


def _bins(values: Array, kinds: Array) -> Array:
    """Bin numbers ``(N,)``: quantiles of the values within each kind."""
    found = np.zeros(len(values), dtype=np.int64)
    for number, kind in enumerate(np.unique(kinds)):
        rows = kinds == kind
        edges = np.quantile(values[rows], np.arange(1, POSITION_BINS) / POSITION_BINS)
        found[rows] = number * POSITION_BINS + np.searchsorted(edges, values[rows])
    return found


def _without_means(values: Array, groups: Array) -> Array:
    counts = np.maximum(np.bincount(groups), 1)
    rest: Array = values - (np.bincount(groups, values) / counts)[groups]
    return rest


def _ranks_within(values: Array, groups: Array, counted: Array) -> Array:
    """Ranks ``(E,)`` among those counted of the same group, from -.5 to .5; 0 for a lone one."""
    ranks = np.zeros(len(values))
    for group in np.unique(groups):
        rows = counted & (groups == group)
        if rows.sum() > 1:
            ranks[rows] = (rankdata(values[rows]) - 0.5) / rows.sum() - 0.5
    return ranks
