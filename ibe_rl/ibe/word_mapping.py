"""Learns the meaning of words that have no order: along which axes they are told apart, and their shares there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score, pairwise_distances_argmin
from sklearn.preprocessing import StandardScaler

from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.mapping import ClusterMapping, gap_between, purities_of
from ibe_rl.ibe.mistakes import best_fit, regression
from ibe_rl.ibe.space import SPARSITY_THRESHOLDS, Space, TooLittleDataError, along
from ibe_rl.ibe.split import count_distinct, split
from ibe_rl.ibe.word_meaning import MIN_HEARD, auc_of, balanced_shares, word_meanings
from ibe_rl.types import Array

TINY_SINGULAR = 1e-3
"""Of an axis, relative to the first one: smaller ones are rounding."""
MAX_LOSS, MAX_BALANCED_LOSS = 0.04, 0.08
"""Accuracy that leaving out dimensions of the state may cost. With mistakes that last, further ones seem to help; the
second one is less than one of twelve words."""
LOSS = 0.025
"""Balanced accuracy that leaving out further axes may cost."""
SAME_WAY = 0.02
"""A dimension that moves by so many standard deviations the same way after every word is no consequence of them."""
GAIN = 0.1
"""Balanced accuracy above chance from which words depend on the state."""
ALIKE_AUC = 0.6
"""Two words that neither the movement after them nor the state before them tells apart better than this are alike."""


def fit_words(
    windows: Windows,
    states: Array,
    instructions: Array,
    *,
    clusters_per_axis: int,
    kept: Array,
    n_init: int = 4,
    max_fit_windows: int = 20_000,
    seed: int = 0,
) -> ClusterMapping:
    """Learn which movements go with which words.

    The words are told apart by a sparse multinomial regression on the state in which they are said. It gives the axes
    that they are about, without the dimensions that move the same way whatever is said. Where words do not depend on
    the state, the regression is on the movement after them. Movements of the best episodes are clustered along these
    axes, and the mean of the one-hot instructions in a cluster (the paper's e^i) is the share of each word. Expressions
    are these shares, as if all words were said equally often.

    Args:
        windows: of the best episodes, each with a word: one-hot instructions ``(W, d)``.
        states: ``(N, S)`` in which words were said, of good and bad episodes.
        instructions: ``(N, d)`` the words.
        clusters_per_axis: clusters for each axis found.
        kept: ``(S,)`` bool, dimensions that count.
        n_init: see ``IBEMapping``.
        max_fit_windows: axes and clusters are learnt from at most so many, a random sample.
        seed: of samples and clustering.

    Raises:
        TooLittleDataError: if fewer than two words were heard often enough, or nothing moves.
    """
    random = np.random.default_rng(seed)
    rows = random.permutation(len(windows))[:max_fit_windows]
    said, slots = windows.instruction.argmax(axis=1), windows.instruction.shape[1]
    often = np.bincount(said, minlength=slots) >= MIN_HEARD
    if often.sum() < 2:
        raise TooLittleDataError("fewer than two words were heard often enough in the best episodes")
    axes = word_axes(windows.delta, said, often, states, instructions.argmax(axis=1), kept, rows, seed)
    space = along(axes)
    places = space.place(windows.delta)
    k = min(clusters_per_axis * axes.shape[1], count_distinct(places[rows], symmetric=False))
    if k < 2:
        raise TooLittleDataError("nothing has moved along what the words are about")
    centres = split(places[rows], np.ones(len(rows)), k, "kmeans", n_init, None, seed)
    labels = pairwise_distances_argmin(places, centres)
    same = alike_pairs(labels, said, often, states, instructions.argmax(axis=1), seed)
    return _named(windows, space, centres, labels, same)


def _named(
    windows: Windows, space: Space, centres: Array, labels: Array, same: Sequence[tuple[int, int]]
) -> ClusterMapping:
    """The mapping with its mean instructions and expressions; of ``same`` words the more frequent one is spoken."""
    k, said, slots = len(centres), windows.instruction.argmax(axis=1), windows.instruction.shape[1]
    meanings = list(word_meanings(windows, labels, k))
    shares = balanced_shares(labels, said, k, slots) * [one.positive for one in meanings]
    total = shares.sum(axis=1, keepdims=True)
    shares = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0)
    often = np.bincount(said, minlength=slots)
    for one, other in same:
        more, less = (one, other) if often[one] >= often[other] else (other, one)
        shares[:, more] += shares[:, less]
        shares[:, less] = 0
        meanings[less] = replace(meanings[less], same_as=more)
    sizes = np.bincount(labels, minlength=k)
    sums = np.stack([np.bincount(labels, column, k) for column in windows.instruction.T], axis=1)
    means = sums / np.maximum(sizes, 1)[:, None]
    order = np.lexsort((means[:, 0], shares[:, 0]))
    return ClusterMapping(
        space,
        centres[order],
        mean_instructions=means[order],
        expressions=shares[order],
        sizes=sizes[order],
        purities=purities_of(labels, sizes, windows.instruction)[order],
        evidence=sizes[order].astype(float),
        ids=np.arange(k),
        width=gap_between(centres),
        meanings=tuple(meanings),
    )


def in_shares(mapping: ClusterMapping) -> ClusterMapping:
    """A vocabulary whose expressions lie between -1 and 1 with expressions from 0 to 1, as shares of words do."""
    values = np.asarray(mapping.expressions)
    return replace(mapping, expressions=(values + 1) / 2) if values.min() < 0 else mapping


def with_word_meanings(mapping: ClusterMapping, windows: Windows) -> ClusterMapping:
    """A vocabulary of words, learnt as one of numbers, with shares, and with what the words mean as movement."""
    meanings = word_meanings(windows, mapping.cluster(windows.delta), len(mapping.ids))
    return replace(in_shares(mapping), meanings=meanings)


def word_axes(
    delta: Array, said: Array, often: Array, states: Array, heard: Array, kept: Array, rows: Array, seed: int
) -> Array:
    """The axes ``(S, p)`` that words are about, in units of the usual movement along each.

    Args:
        delta: ``(W, S)`` movements of the best episodes.
        said: ``(W,)`` the slot of the word before each.
        often: ``(d,)`` bool, words that count.
        states: ``(N, S)`` states with a word.
        heard: ``(N,)`` the slot of that word.
        kept: ``(S,)`` bool, dimensions that count.
        rows: windows to learn from.
        seed: of the solver.

    Raises:
        TooLittleDataError: if no movement goes with the words.
    """
    spread = delta.std(axis=0)
    some = rows[often[said[rows]]]
    weights = _axes_of_states(states[often[heard]], heard[often[heard]], seed)
    if weights is None:
        moves = delta[some] / np.where(spread > 0, spread, 1)
        weights = _judged(regression(moves, said[some], seed), moves, said[some])[0]
        weights = weights / np.where(spread > 0, spread, 1)
    else:
        moved = _consequences(delta, said, often, spread)
        weights = weights * moved if np.any(weights * moved * kept) else weights
    weights = (weights - weights.mean(axis=0)) * kept
    _, strength, directions = np.linalg.svd(weights * spread, full_matrices=False)
    count = int((strength > TINY_SINGULAR * strength[0]).sum()) if strength[0] > 0 else 0
    if not count:
        raise TooLittleDataError("no movement goes with the words")
    axes = directions[:count].T / np.where(spread > 0, spread, np.inf)[:, None]
    axes = axes[:, : _needed(delta[some] @ axes, said[some], seed)]
    usual: Array = (delta @ axes).std(axis=0)
    return axes / np.where(usual > 0, usual, 1)


def _needed(places: Array, words: Array, seed: int) -> int:
    """How many of the axes, the first ones, are needed to tell the words apart by the movement as well as with all.

    Args:
        places: ``(N, P)`` movements along all axes.
        words: ``(N,)`` what was said before, by slot.
        seed: of the solver.
    """
    standard = StandardScaler().fit_transform(places)

    def told_apart(count: int) -> float:
        return _judged(regression(standard[:, :count], words, seed), standard[:, :count], words)[2]

    enough = told_apart(places.shape[1]) - LOSS
    return next((count for count in range(1, places.shape[1]) if told_apart(count) >= enough), places.shape[1])


def _axes_of_states(states: Array, heard: Array, seed: int) -> Array | None:
    """Weights ``(words, S)`` of a sparse regression of the word on the state; None if it does not depend on it."""
    if len(np.unique(heard)) < 2:
        return None
    scaler = StandardScaler().fit(states)
    standard = scaler.transform(states)
    kinds = np.unique(heard, return_inverse=True)[1]
    fit, model = best_fit(standard, kinds, seed)
    weights, accuracy, balanced = _judged(model, standard, kinds)
    if balanced < 1 / len(np.unique(heard)) + GAIN:
        return None
    largest = np.abs(weights).max(axis=0)
    for share in SPARSITY_THRESHOLDS:
        counts = largest >= share * largest.max()
        sparse, without, balanced_without = _judged(fit(standard * counts, kinds, seed), standard * counts, kinds)
        if without >= accuracy - MAX_LOSS and balanced_without >= balanced - MAX_BALANCED_LOSS:
            weights = sparse * counts
            break
    return weights / scaler.scale_


def _judged(model: LogisticRegression, features: Array, words: Array) -> tuple[Array, float, float]:
    """Weights ``(words, S)`` of a multinomial logistic regression, its accuracy and its balanced accuracy."""
    weights = model.coef_ if len(model.classes_) > 2 else np.concatenate([-model.coef_, model.coef_])
    guessed = model.predict(features)
    return weights, float(np.mean(guessed == words)), float(balanced_accuracy_score(words, guessed))


def _consequences(delta: Array, said: Array, often: Array, spread: Array) -> Array:
    """Which dimensions ``(S,)`` do not move the same way after every word; the others are conditions of the words."""
    means = np.stack([delta[said == slot].mean(axis=0) for slot in np.flatnonzero(often)])
    same: Array = (means.min(axis=0) > SAME_WAY * spread) | (means.max(axis=0) < -SAME_WAY * spread)
    return ~same


def alike_pairs(
    labels: Array, said: Array, often: Array, states: Array, heard: Array, seed: int
) -> list[tuple[int, int]]:
    """Pairs of words that neither the movement after them nor the state before them tells apart.

    Of words, by slot, that are said ``often`` ``(d,)``: clusters ``(W,)`` and words ``(W,)`` of windows, and states
    ``(N, S)`` with their words ``(N,)``.
    """
    found = []
    for one, other in combinations(np.flatnonzero(often).tolist(), 2):
        rows, before = np.isin(said, (one, other)), np.isin(heard, (one, other))
        shares = balanced_shares(labels[rows], said[rows], int(labels.max()) + 1, len(often))[labels[rows], one]
        moved = auc_of(shares, said[rows] == one)
        if moved < ALIKE_AUC and _told_apart(states[before], heard[before] == one, seed) < ALIKE_AUC:
            found.append((one, other))
    return found


def _told_apart(states: Array, one: Array, seed: int) -> float:
    """AUC of a regression on the state for which of two words was said, on the other half of the states."""
    half = np.arange(len(states)) % 2 == 0
    if len(np.unique(one[half])) < 2 or len(np.unique(one[~half])) < 2:
        return 1.0
    scaler = StandardScaler().fit(states[half])
    model = LogisticRegression(max_iter=500, random_state=seed).fit(scaler.transform(states[half]), one[half])
    return auc_of(model.decision_function(scaler.transform(states[~half])), one[~half])
