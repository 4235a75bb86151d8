"""Parts of the state in which an instructor says the same, for ``delay``: few dimensions, an axis, a partition."""

from __future__ import annotations

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.tree import DecisionTreeClassifier

from ibe_rl.ibe.mistakes import fit_despite_mistakes
from ibe_rl.types import Array

MOST_LEVELS, LEVELS = 9, 5
"""A number with more distinct values is divided into levels, equally many steps in each."""
MOST_DIMENSIONS = 5
MOST_PARTS, MIN_PART_STEPS = 16, 20
RIDGE = 1e-6
ROUNDS = 3
"""Of learning which steps are mistakes, and the axes without them."""


def levels_of(column: Array, given: Array) -> Array:
    """What was said as classes ``(N,)``: values or levels of one number, silence as the last."""
    values, kinds = np.unique(column, return_inverse=True)
    if len(values) > MOST_LEVELS:
        kinds = np.searchsorted(np.quantile(column[given], np.arange(1, LEVELS) / LEVELS), column)
    kinds = np.where(given, kinds, kinds.max() + 1)
    return np.unique(kinds, return_inverse=True)[1]


def supports(states: Array, said: Array) -> list[tuple[list[int], Array]]:
    """Ever fewer dimensions that a linear regression of ``said`` ``(N,)`` on ``states`` needs, and their weights."""
    centred, target = states - states.mean(axis=0), said - said.mean()
    square, product = centred.T @ centred, centred.T @ target
    left, found = [*np.flatnonzero(np.diag(square) > 0)], []
    square = square + RIDGE * len(states) * np.eye(len(square))
    while left:
        inverse = np.linalg.inv(square[np.ix_(left, left)])
        weights = inverse @ product[left]
        if len(left) <= MOST_DIMENSIONS:
            found.append(([int(each) for each in left], weights))
        left.pop(int(np.argmin(weights**2 / np.diag(inverse))))
    return found


def axes_of(states: Array, kinds: Array) -> Array:
    """Axes ``(S, D)`` along which what is said changes, ``D`` below the number of classes.

    A logistic regression of ``kinds`` ``(N,)``, some of which are mistakes.
    """
    model = LogisticRegression(C=100, solver="newton-cholesky", max_iter=30, warm_start=True)
    fit_despite_mistakes(model, states, np.unique(kinds, return_inverse=True)[1], ROUNDS)
    _, sizes, axes = np.linalg.svd(model.coef_, full_matrices=False)
    kept = sizes > 1e-6 * sizes[0]
    directions: Array = (axes[kept] * sizes[kept, None]).T
    return directions


def partition(places: Array, kinds: Array) -> DecisionTreeClassifier:
    """A tree that divides places ``(N, D)`` into parts in which the same is said."""
    tree = DecisionTreeClassifier(
        criterion="entropy", max_leaf_nodes=MOST_PARTS, min_samples_leaf=MIN_PART_STEPS, random_state=0
    )
    return tree.fit(places, kinds)


def part_of(tree: DecisionTreeClassifier, places: Array) -> Array:
    """The number of the part ``(N,)`` of places ``(N, D)``, from 0."""
    leaves = tree.apply(places.astype(np.float32))
    numbers = np.zeros(tree.tree_.node_count, np.int64)
    ends = np.flatnonzero(tree.tree_.children_left < 0)
    numbers[ends] = np.arange(len(ends))
    return numbers[leaves]


def ranked_parts(places: Array) -> Array:
    """The part ``(N,)`` of places on a line ``(N,)``: quantiles, equally many steps in each."""
    edges = np.quantile(places[:: max(1, len(places) // 4_000)], np.arange(1, MOST_PARTS) / MOST_PARTS)
    return np.searchsorted(edges, places)


def table_of(parts: Array, kinds: Array) -> Array:
    """How often ``(P, K)`` what was said goes with each part."""
    count = int(kinds.max()) + 1
    rows = int(parts.max()) + 1
    return np.bincount(parts * count + kinds, minlength=rows * count).reshape(rows, count)


def information_of(parts: Array, kinds: Array) -> float:
    """Mutual information of parts and what was said, in nats."""
    table = table_of(parts, kinds) / len(kinds)
    both = table.sum(axis=1, keepdims=True) * table.sum(axis=0)
    known = table > 0
    return float(table[known] @ np.log(table[known] / both[known]))


def gains(parts: Array, kinds: Array) -> Array:
    """How much likelier ``(N,)`` what was said is where its part is known, in nats; its mean is ``information_of``."""
    table = table_of(parts, kinds) + 1e-9
    ratio = np.log(table * table.sum() / (table.sum(axis=1, keepdims=True) * table.sum(axis=0)))
    found: Array = ratio[parts, kinds]
    return found
