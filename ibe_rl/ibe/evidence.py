"""Where the meaning of an instruction shows: four sources, each with its interval over episodes."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata

from ibe_rl.ibe.meaning import Evidence
from ibe_rl.ibe.record import Record
from ibe_rl.types import Array

RESAMPLES, INTERVAL = 400, (0.5, 99.5)
"""Bootstrap over whole episodes; percent. Eighty logs are judged by four sources each: 95 % would err too often."""
BINS = 10
"""Of similar places."""
FITTED_STEPS, MOST_WITH_PRODUCTS = 2_500, 12
"""A regression on the state sees so many steps; with more dimensions it has no squares and products."""
FEWEST_EPISODES, FEWEST_WINDOWS = 8, 5
"""With fewer episodes a source says nothing; an episode with fewer windows does not say what it was told."""


def satisfaction(record: Record, axis: Array, number: int, seed: int) -> Evidence | None:
    """After which movement the instructor stops asking for it, and after which they begin to.

    By how much more the state moved along the axis where the instructor asks for less at the end of a window than at
    its beginning, among windows that began with the same instruction at a similar place; in standard deviations for a
    change of the instruction by 1. It needs neither reward nor obedience. An instructor who says what is happening
    anyway ("push with the swing") looks the other way round.

    Args:
        record: of good and bad episodes.
        axis: ``(S,)``.
        number: of the instruction.
        seed: of the resampling.
    """
    signs, last = record.signs(number), record.last_heard(number)
    place = record.states @ axis
    rows = np.flatnonzero(last > np.arange(len(record)))
    moved, less = (place[last] - place)[rows] / _scale(record, axis), (signs - signs[last])[rows]
    alike = _bins(place[rows], signs[rows])
    moved, less = _without_means(moved, alike), _without_means(less, alike)
    changed = np.unique(record.episode[rows[less > 0]])
    weights = _resamples(record.size, seed)
    sums = [np.bincount(record.episode[rows], values, record.size) for values in (moved * less, less**2)]
    above, below = (weights @ each for each in sums)
    slope = np.divide(above, below, out=np.full(len(above), np.nan), where=below > 1e-9)
    return _evidence("satisfaction", slope, len(changed))


def best(record: Record, axis: Array, number: int, among: Array, seed: int) -> Evidence | None:
    """How far some episodes moved the way that was told, on average over windows (the paper's source).

    Args:
        record: of good and bad episodes.
        axis: ``(S,)``.
        number: of the instruction.
        among: ``(E,)`` bool, the episodes that count.
        seed: of the resampling.
    """
    signs = record.signs(number)
    rows = (signs != 0) & among[record.episode]
    if not rows.any():
        return None
    means = _means(record, _standard(record, axis) * signs, [rows], seed)
    return _evidence("best", means[:, 0], _episodes(record, rows))


def pays(record: Record, axis: Array, number: int, seed: int) -> Evidence | None:
    """Whether episodes earn more in which the movement that was told was larger.

    A rank correlation, within each context, of the total reward with the mean movement the way that was told.

    Args:
        record: of good and bad episodes.
        axis: ``(S,)``.
        number: of the instruction.
        seed: of the resampling.
    """
    signs = record.signs(number)
    windows = np.bincount(record.episode[signs != 0], minlength=record.size)
    moved = np.bincount(record.episode, _standard(record, axis) * signs, record.size)
    told = windows >= FEWEST_WINDOWS
    followed = np.divide(moved, windows, out=np.zeros(record.size), where=told)
    first, second = (_ranks_within(values, record.contexts, told)[told] for values in (followed, record.returns))
    if told.sum() < FEWEST_EPISODES or min(np.ptp(first), np.ptp(second)) == 0:
        return None
    return _evidence("pays", _correlation(first, second, np.arange(len(first)), len(first), seed), len(first))


def pays_at_once(record: Record, axis: Array, number: int, seed: int) -> Evidence | None:
    """Whether windows earn more in which the agent moved more the way that was told than usual in such a state.

    A correlation of what was not to be expected of both, from the state and from what was told in it: how much an agent
    moves, and what a swing does by itself, do not count. None where all windows earn the same, as with a reward for
    each step. The rest is as in ``pays``.
    """
    signs = record.signs(number)
    rows = np.flatnonzero((signs != 0) & record.whole)
    earned = record.earned[rows]
    if len(rows) < FEWEST_WINDOWS or np.ptp(earned) <= 1e-6 * max(1.0, float(np.abs(earned).max())):
        return None
    expected = _expectable(record.states[rows], signs[rows])
    moved, earned = _unexpected(expected, np.column_stack([_standard(record, axis)[rows], earned])).T
    both = _correlation(moved * signs[rows], earned, record.episode[rows], record.size, seed)
    return _evidence("pays_at_once", both, _episodes(record, rows))


def influence(record: Record, axis: Array, up: Array, down: Array, seed: int) -> Evidence | None:
    """What the agent does otherwise if it is told otherwise in the same state.

    Args:
        record: of the log, whose movements are the unit.
        axis: ``(S,)``.
        up: ``(M, S)`` changes of the state from ``M`` states of different episodes when it is told +1.
        down: ``(M, S)`` from the same states when it is told -1.
        seed: of the resampling.
    """
    if len(up) < FEWEST_EPISODES:
        return None
    differs = (up - down) @ axis / (2 * _scale(record, axis))
    return _evidence("influence", (_resamples(len(up), seed) @ differs) / len(up), len(up))


def influence_of_plan(record: Record, axis: Array, number: int, seed: int) -> Evidence | None:
    """The same from the log, where what is said does not depend on the state: told at random, so to speak.

    From every other episode: an axis has been looked for in those between.
    """
    signs = record.signs(number) * (record.episode % 2)
    groups = [signs == 1, signs == -1]
    if not groups[0].any() or not groups[1].any():
        return None
    means = _means(record, _standard(record, axis), groups, seed)
    return _evidence("influence", (means[:, 0] - means[:, 1]) / 2, _episodes(record, signs != 0))


def _correlation(first: Array, second: Array, episode: Array, count: int, seed: int) -> Array:
    """Of two columns ``(N,)`` about 0, on every resample ``(R,)`` of episodes; nan where one is constant."""
    weights = _resamples(count, seed)
    squares = [weights @ np.bincount(episode, values**2, count) for values in (first, second)]
    both, spread = weights @ np.bincount(episode, first * second, count), np.sqrt(squares[0] * squares[1])
    return np.divide(both, spread, out=np.full(len(both), np.nan), where=spread > 0)


def _expectable(states: Array, signs: Array) -> Array:
    """Columns of a regression on the state, its squares and products, and on what was told in it."""
    spread = states.std(axis=0)
    standard = (states - states.mean(axis=0)) / np.where(spread > 0, spread, 1)
    linear = np.column_stack([np.ones(len(states)), standard])
    told = [linear * (signs == sign)[:, None] for sign in (-1, 1)]
    if states.shape[1] > MOST_WITH_PRODUCTS:
        return np.concatenate(told, axis=1)
    first, second = np.triu_indices(states.shape[1])
    return np.concatenate([*told, standard[:, first] * standard[:, second]], axis=1)


def _unexpected(columns: Array, values: Array) -> Array:
    """What is left of values ``(N, 2)`` after a regression on ``columns``, fitted on some of them."""
    some = slice(None, None, max(1, len(columns) // FITTED_STEPS))
    left: Array = values - columns @ np.linalg.lstsq(columns[some], values[some], rcond=1e-6)[0]
    return left


def _bins(values: Array, kinds: Array) -> Array:
    """Numbers ``(N,)`` of groups of the same kind and of similar value."""
    found = np.zeros(len(values), dtype=np.int64)
    for number, kind in enumerate(np.unique(kinds)):
        rows = kinds == kind
        edges = np.quantile(values[rows], np.arange(1, BINS) / BINS)
        found[rows] = number * BINS + np.searchsorted(edges, values[rows])
    return found


def _without_means(values: Array, groups: Array) -> Array:
    counts = np.maximum(np.bincount(groups), 1)
    rest: Array = values - (np.bincount(groups, values) / counts)[groups]
    return rest


def _scale(record: Record, axis: Array) -> float:
    return float(np.std(record.delta @ axis)) or 1.0


def _standard(record: Record, axis: Array) -> Array:
    moved: Array = record.delta @ axis / _scale(record, axis)
    return moved


def _resamples(count: int, seed: int) -> Array:
    """How often ``(R, count)`` each is drawn; the first draw is the sample itself."""
    weights = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), RESAMPLES)
    weights[0] = 1
    return weights


def _means(record: Record, values: Array, groups: list[Array], seed: int) -> Array:
    """Mean of values ``(N,)`` over each group of rows, ``(R, G)`` on every resample of whole episodes."""
    weights = _resamples(record.size, seed)
    sums = [np.bincount(record.episode[rows], values[rows], record.size) for rows in groups]
    counts = [np.bincount(record.episode[rows], minlength=record.size) for rows in groups]
    total, of = weights @ np.stack(sums, axis=1), weights @ np.stack(counts, axis=1)
    return np.divide(total, of, out=np.full(total.shape, np.nan), where=of > 0)


def _episodes(record: Record, rows: Array) -> int:
    return len(np.unique(record.episode[rows]))


def _evidence(source: str, values: Array, episodes: int) -> Evidence | None:
    """From the values on every resample, the sample's own first; None if too few episodes carry it."""
    known = values[~np.isnan(values)]
    if episodes < FEWEST_EPISODES or np.isnan(values[0]) or len(known) < len(values) / 2:
        return None
    low, high = np.percentile(known, INTERVAL)
    return Evidence(source, float(values[0]), float(low), float(high), episodes)


def _ranks_within(values: Array, groups: Array, counted: Array) -> Array:
    """Ranks ``(E,)`` among those counted of the same group, from -.5 to .5; a lone one has the middle."""
    ranks = np.zeros(len(values))
    for group in np.unique(groups):
        rows = counted & (groups == group)
        if rows.sum() > 1:
            ranks[rows] = (rankdata(values[rows]) - 0.5) / rows.sum() - 0.5
    return ranks
