"""Ways to divide places into clusters: scikit-learn's."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import BisectingKMeans, KMeans
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import pairwise_distances

from ibe_rl.types import Array

SPLITS = ("kmeans", "bisecting", "quantile")
FEWEST_WITH_REST = 4
REST = 0.05
"""A movement, on the instructor's scale, that is none."""


def split(places: Array, counts: Array, k: int, how: str, n_init: int, first: Array | None, seed: int) -> Array:
    """Divide places into ``k`` clusters.

    Args:
        places: ``(W, P)``.
        counts: ``(W,)`` how often each counts.
        k: the number of clusters.
        how: "kmeans"; "bisecting" (the largest cluster is halved again and again, which balances them); "quantile"
            (along each axis by itself, as many in each).
        n_init: starts of k-means, the best is kept.
        first: ``(k, P)`` where k-means starts instead; the others begin anew.
        seed: of the starts.

    Returns:
        centres ``(k, P)``.

    Raises:
        ValueError: for another ``how``.
    """
    if how == "kmeans":
        starts = {"n_init": n_init} if first is None else {"n_init": 1, "init": first}
        with warnings.catch_warnings():  # clusters that nobody needs may lie on others
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
    """Divide places and their opposites alike; as ``split``, but the centres are their own mirror image."""
    places, counts = np.concatenate([places, -places]), np.append(counts, counts)
    centres = mirrored(split(places, counts, k, how, n_init, first, seed))
    if how == "kmeans":  # best is often a lopsided division; from a mirrored one k-means goes on to a mirrored one
        centres = mirrored(split(places, counts, k, how, n_init, centres, seed))
    return centres


def with_rest(centres: Array, power: float) -> Array:
    """Draw the innermost pair of mirrored centres ``(k, P)`` in to rest, ``REST``, unless a centre is there already.

    Otherwise a thing at rest would be called by the smallest movement of things that never rest. Three or fewer
    centres stay as they are: an odd number has one in the middle, and two are needed for the two ways.

    Args:
        centres: their own mirror image.
        power: of the magnitude of a movement, see ``Space``.
    """
    moves = np.abs(centres).max(axis=1) ** (1 / power)
    if len(centres) < FEWEST_WITH_REST or moves.min() <= REST:
        return centres
    inner = int(np.argmin(moves))
    pair = [inner, int(np.argmin(pairwise_distances(centres, -centres[[inner]])))]
    rested = centres.copy()
    rested[pair] *= (REST / moves[inner]) ** power  # no farther in than needed, since that costs truth (docs/LOG.md)
    return rested


def mirrored(centres: Array) -> Array:
    """Make a set of centres ``(k, P)`` its own mirror image about no change: each is averaged with its opposite."""
    # squared: several pairings can have the smallest sum of distances, and not all of them are mutual
    opposite = linear_sum_assignment(pairwise_distances(centres, -centres, metric="sqeuclidean"))[1]
    return (centres - centres[opposite]) / 2
