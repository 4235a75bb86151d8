"""The paper's mapping: cluster the changes of the state, give each cluster its mean instruction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.cluster import KMeans
from sklearn.metrics import pairwise_distances_argmin
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from ibe_rl.data import Array, read_only
from ibe_rl.ibe.vocabulary import normalise


class TooLittleDataError(ValueError):
    """The windows cannot carry a vocabulary yet; the message says what is missing."""


@dataclass(frozen=True)
class ClusterMapping:
    """f: change of the state to expression, by the nearest centre.

    Attributes:
        mean: ``(S,)`` taken off a change, in observation units.
        weight: ``(S,)`` multiplied with it then: 1 / standard deviation, 0 for a dimension left out.
        centres: ``(k, S)`` in standardised units.
        mean_instructions: ``(k, d)`` e^i.
        expressions: ``(k, d)`` m^i in [-1, 1]; clusters are sorted by the first number of e^i.
        sizes: ``(k,)`` windows in each cluster when it was learnt.
        purities: ``(k,)`` share of a cluster's windows that carried its most frequent instruction.
        evidence: ``(k,)`` windows that the mean instructions stand on: the sizes, and what is remembered of
            earlier windows.
        ids: ``(k,)`` int, names of the clusters that last over refreshes (``ibe_rl.ibe.identity``).
    """

    mean: Array
    weight: Array
    centres: Array
    mean_instructions: Array
    expressions: Array
    sizes: Array
    purities: Array
    evidence: Array
    ids: Array

    def __post_init__(self) -> None:
        k, dims = np.shape(self.centres)
        shapes: dict[str, tuple[int | None, ...]] = {
            "mean": (dims,),
            "weight": (dims,),
            "centres": (k, dims),
            "mean_instructions": (k, None),
            "expressions": (k, None),
            "sizes": (k,),
            "purities": (k,),
            "evidence": (k,),
            "ids": (k,),
        }
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), np.int64 if name == "ids" else np.float64)
            object.__setattr__(self, name, read_only(values, shape, name))

    def cluster(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to the indices ``(W,)`` of their clusters."""
        return pairwise_distances_argmin((np.asarray(delta, float) - self.mean) * self.weight, self.centres)

    def express(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)``: the paper's equation 2."""
        return self.expressions[self.cluster(delta)]

    def confidence(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to the purities ``(W,)`` of their clusters; not calibrated."""
        return self.purities[self.cluster(delta)]

    def centre_changes(self) -> Array:
        """The centres ``(k, S)`` as changes of the state; a dimension left out has its mean."""
        shares = np.divide(self.centres, self.weight, out=np.zeros_like(self.centres), where=self.weight > 0)
        return self.mean + shares

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        return {name: getattr(self, name).tolist() for name in self.__dataclass_fields__}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``.

        Raises:
            ValueError: if a value is missing or shapes do not fit.
        """
        try:
            return cls(**{name: np.asarray(values[name], float) for name in cls.__dataclass_fields__})
        except KeyError as error:
            raise ValueError(f"the mapping lacks {error}") from None


class PaperMapping(BaseEstimator):
    """IBE's mapping from changes of the state to expressions, as in the paper (section "Mapping ...").

    Standardise, k-means, mean instruction per cluster, min-max between the clusters.

    Args:
        n_clusters: k, at least 2.
        normalisation: "minmax" (literal) or "sign" (keeps the sign of each mean instruction).
        dimensions: indices of the state dimensions to cluster on; None takes all.
        n_init: k-means starts, the best is kept.
        last: an earlier mapping: k-means starts from its centres instead.
        memory: share in [0, 1) that the windows ``last`` stands on still count, each as one at its cluster's
            centre; what it remembered itself fades likewise (streaming k-means with a decay factor).
        max_fit_windows: k-means runs on at most this many windows, drawn at random; sizes and mean
            instructions are of all of them.
        random_state: seed of the k-means starts and of the draw.

    Attributes:
        mapping_: the learnt ``ClusterMapping``.
        labels_: ``(W,)`` clusters of the windows it was fitted on.
    """

    def __init__(
        self,
        n_clusters: int = 8,
        normalisation: str = "minmax",
        dimensions: Sequence[int] | None = None,
        n_init: int = 4,
        last: ClusterMapping | None = None,
        memory: float = 0.0,
        max_fit_windows: int = 20_000,
        random_state: int | None = None,
    ):
        self.n_clusters = n_clusters
        self.normalisation = normalisation
        self.dimensions = dimensions
        self.n_init = n_init
        self.last = last
        self.memory = memory
        self.max_fit_windows = max_fit_windows
        self.random_state = random_state

    def fit(self, delta: Array, instruction: Array) -> Self:
        """Learn the vocabulary.

        Args:
            delta: ``(W, S)`` changes of the state from the best episodes.
            instruction: ``(W,)`` or ``(W, d)`` the instruction at the beginning of each window; windows
                without one must be left out.

        Raises:
            TooLittleDataError: with fewer distinct windows than clusters.
            ValueError: if ``n_clusters`` is below 2, ``memory`` is outside [0, 1), the lengths differ, or
                ``last`` has another number of clusters or dimensions.
        """
        if self.n_clusters < 2:
            raise ValueError(f"n_clusters={self.n_clusters}: at least 2")
        if not 0 <= self.memory < 1:
            raise ValueError(f"memory={self.memory}: at least 0 and below 1")
        delta = np.asarray(delta, float)
        instruction = np.asarray(instruction, float)
        instruction = instruction[:, None] if instruction.ndim == 1 else instruction
        if len(delta) != len(instruction):
            raise ValueError(f"{len(delta)} windows but {len(instruction)} instructions")
        centres, mean, weight = self._split(delta)
        self.mapping_, self.labels_ = self._name(delta, instruction, centres, mean, weight)
        return self

    def predict(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)``."""
        check_is_fitted(self)
        return self.mapping_.express(delta)

    def _split(self, delta: Array) -> tuple[Array, Array, Array]:
        """Standardise and cluster; return centres, mean and weight as ``ClusterMapping`` holds them."""
        if not len(delta):
            raise TooLittleDataError(f"0 distinct windows for n_clusters={self.n_clusters}")
        if self.last is not None:
            read_only(self.last.centres, (self.n_clusters, delta.shape[1]), "last")
        random = np.random.default_rng(self.random_state)
        mean, weight = self._standard(delta)
        rows = random.permutation(len(delta))[: self.max_fit_windows]
        standard = (delta[rows] - mean) * weight
        distinct = len(np.unique(standard, axis=0))
        if distinct < self.n_clusters:
            raise TooLittleDataError(f"{distinct} distinct windows for n_clusters={self.n_clusters}")
        counts = np.full(len(rows), len(delta) / len(rows))
        starts: dict[str, Any] = {"n_init": self.n_init}
        if self.last is not None:
            first = (self.last.centre_changes() - mean) * weight
            starts = {"n_init": 1, "init": first}
            standard, counts = np.concatenate([standard, first]), np.append(counts, self.memory * self.last.evidence)
        kmeans = KMeans(self.n_clusters, random_state=int(random.integers(2**31)), **starts)
        return kmeans.fit(standard, sample_weight=counts).cluster_centers_, mean, weight

    def _standard(self, delta: Array) -> tuple[Array, Array]:
        """Mean, and 1 / standard deviation of the dimensions to cluster on; those of ``last`` count as remembered."""
        scaler = StandardScaler().fit(delta)
        mean, variance = scaler.mean_, scaler.scale_**2
        if self.last is not None:
            remembered = self.memory * self.last.evidence.sum()
            new = len(delta) / (len(delta) + remembered)
            earlier = np.divide(1, self.last.weight, out=np.ones_like(mean), where=self.last.weight > 0) ** 2
            mean, variance = (1 - new) * self.last.mean + new * mean, (1 - new) * earlier + new * variance
        weight = 1 / np.sqrt(variance)
        if self.dimensions is not None:
            weight[~np.isin(np.arange(delta.shape[1]), self.dimensions)] = 0
        return mean, weight

    def _name(
        self, delta: Array, instruction: Array, centres: Array, mean: Array, weight: Array
    ) -> tuple[ClusterMapping, Array]:
        """Give each cluster the mean of its instructions (the paper's equations 3 to 5) and normalise; and labels."""
        k = len(centres)
        labels = pairwise_distances_argmin((delta - mean) * weight, centres)
        sizes = np.bincount(labels, minlength=k)
        sums = np.stack([np.bincount(labels, column, k) for column in instruction.T], axis=1)
        evidence = sizes.astype(float)
        if self.last is not None:
            remembered = self.memory * self.last.evidence
            earlier = pairwise_distances_argmin((self.last.centre_changes() - mean) * weight, centres)
            np.add.at(evidence, earlier, remembered)
            np.add.at(sums, earlier, remembered[:, None] * self.last.mean_instructions)
        means = np.where(evidence[:, None] > 0, sums / np.maximum(evidence, 1e-9)[:, None], instruction.mean(axis=0))
        order = np.argsort(means[:, 0], kind="stable")
        named = ClusterMapping(
            mean,
            weight,
            centres[order],
            mean_instructions=means[order],
            expressions=normalise(means, self.normalisation)[order],
            sizes=sizes[order],
            purities=_purities(labels, sizes, instruction)[order],
            evidence=evidence[order],
            ids=np.arange(k),
        )
        return named, np.argsort(order)[labels]


def _purities(labels: Array, sizes: Array, instruction: Array) -> Array:
    """Share ``(k,)`` of each cluster's windows with its most frequent instruction; 0 for an empty cluster."""
    kinds = np.zeros(len(labels), dtype=np.int64)
    for column in instruction.T:
        values, rank = np.unique(column, return_inverse=True)
        kinds = kinds * len(values) + rank
    kinds = np.unique(kinds, return_inverse=True)[1]
    count = kinds.max() + 1
    table = np.bincount(labels * count + kinds, minlength=len(sizes) * count).reshape(len(sizes), count)
    most: Array = table.max(axis=1) / np.maximum(sizes, 1)
    return most
