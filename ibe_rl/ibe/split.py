"""Clustering algorithms, and clusterings that are their own mirror image."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import BisectingKMeans, KMeans
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import pairwise_distances

from ibe_rl.types import Array

SPLITS = ("kmeans", "bisecting", "quantile")
MIN_CLUSTERS_WITH_REST = 4
DISTINCT_DECIMALS = 9
"""Places that agree to so many decimals are one: equal changes may be projected with other rounding errors."""
REST = 0.05
"""A movement as small as this, on the instructor's scale, counts as rest."""


def count_distinct(places: Array, symmetric: bool) -> int:
    """How many of the places ``(W, P)`` differ, with their mirror images if ``symmetric``."""
    both = np.concatenate([places, -places]) if symmetric else places
    return len(np.unique(both.round(DISTINCT_DECIMALS), axis=0))


def split(places: Array, counts: Array, k: int, how: str, n_init: int, first: Array | None, seed: int) -> Array:
    """Divide places into ``k`` clusters.

    Args:
        places: ``(W, P)``.
        counts: ``(W,)`` sample weights.
        k: the number of clusters.
        how: "kmeans"; "bisecting": bisecting k-means of the largest cluster, which balances their sizes; "quantile":
            clusters of equal size, along each axis on its own.
        n_init: number of k-means initialisations, the best is kept.
        first: ``(k, P)`` initial centres of k-means instead; the other algorithms ignore it.
        seed: of the initialisations.

    Returns:
        The centres ``(k, P)``.

    Raises:
        ValueError: for another ``how``.
    """
    if how == "kmeans":
        starts = {"n_init": n_init} if first is None else {"n_init": 1, "init": first}
        with warnings.catch_warnings():  # with few distinct places some clusters coincide
            warnings.simplefilter("ignore", ConvergenceWarning)
            return KMeans(k, random_state=seed, **starts).fit(places, sample_weight=counts).cluster_centers_
    if how == "bisecting":
        halved = BisectingKMeans(k, n_init=n_init, random_state=seed, bisecting_strategy="largest_cluster")
        return halved.fit(places, sample_weight=counts).cluster_centers_
    if how == "quantile":
        middles = (np.arange(k) + 0.5) / k
        return np.quantile(places, middles, axis=0, weights=counts, method="inverted_cdf")
    raise ValueError(f"split={how!r}: choose one of {', '.join(SPLITS)}")


def split_mirrored(
    places: Array, counts: Array, k: int, how: str, n_init: int, first: Array | None, seed: int
) -> Array:
    """As ``split``, of the places and their mirror images: the set of centres is its own mirror image."""
    places, counts = np.concatenate([places, -places]), np.append(counts, counts)
    centres = mirrored(split(places, counts, k, how, n_init, first, seed))
    if how == "kmeans":  # its optimum is often lopsided, but a symmetric initialisation leads to a symmetric one
        centres = mirrored(split(places, counts, k, how, n_init, centres, seed))
    return centres


def with_rest(centres: Array, power: float) -> Array:
    """Move the innermost pair of mirrored centres ``(k, P)`` to ``REST``, unless a centre is there already.

    Otherwise rest would be named by the smallest movement wherever nothing rests in the data. Three or fewer centres
    stay as they are: an odd number has one in the middle, and two are needed for the two signs. ``power`` is that of
    the ``Space``.
    """
    moves = np.abs(centres).max(axis=1) ** (1 / power)
    if len(centres) < MIN_CLUSTERS_WITH_REST or moves.min() <= REST:
        return centres
    inner = int(np.argmin(moves))
    pair = [inner, int(np.argmin(pairwise_distances(centres, -centres[[inner]])))]
    rested = centres.copy()
    rested[pair] *= (REST / moves[inner]) ** power  # moving it further in costs accuracy (docs/LOG.md)
    return rested


def mirrored(centres: Array) -> Array:
    """Make a set of centres ``(k, P)`` symmetric about 0: each is averaged with the opposite of its partner."""
    # squared distances: with plain ones several matchings can be optimal, and not all of them are mutual
    opposite = linear_sum_assignment(pairwise_distances(centres, -centres, metric="sqeuclidean"))[1]
    return (centres - centres[opposite]) / 2
