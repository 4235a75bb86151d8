"""Match the clusters of one refresh to those of the next, so that they keep their ids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from sklearn.metrics.cluster import contingency_matrix

from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.types import Array


@dataclass(frozen=True)
class ClusterTransition:
    """Which clusters survived, vanished and emerged (as in MONIC, Spiliopoulou et al. 2006).

    Attributes:
        survived: by id, the Jaccard index of the windows of the cluster before and after.
        vanished: ids that are gone.
        emerged: ids that are new.
    """

    survived: Mapping[int, float]
    vanished: tuple[int, ...]
    emerged: tuple[int, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        survived = [{"id": name, "overlap": overlap} for name, overlap in self.survived.items()]
        return {"survived": survived, "vanished": list(self.vanished), "emerged": list(self.emerged)}


def keep_identity(
    last: ClusterMapping,
    new: ClusterMapping,
    probe: Array,
    next_id: int,
    survival_overlap: float = 0.5,
    hold_within: float = 0.0,
) -> tuple[ClusterMapping, ClusterTransition]:
    """Give the clusters of ``new`` the ids of the matching ones of ``last``.

    The matching maximises the sum of the overlaps (Hungarian method). Each centre counts as one more window, so that
    clusters without any window of the probe can be matched too.

    Args:
        last: the mapping before.
        new: the one after.
        probe: ``(P, S)`` changes of the state, the same at each refresh.
        next_id: the first unused id.
        survival_overlap: a pair that overlaps less has not survived: one vanished, one emerged.
        hold_within: a survivor whose expression moved by no more than this keeps the old one, so that words do not
            change with noise.

    Returns:
        ``new`` with lasting ids and held expressions, and what became of the clusters.
    """
    points = np.concatenate([probe, last.centre_changes(), new.centre_changes()])
    overlap = _overlap(last.cluster(points), new.cluster(points), len(last.ids), len(new.ids))
    pairs = [pair for pair in zip(*linear_sum_assignment(-overlap), strict=True) if overlap[pair] >= survival_overlap]
    ids, expressions, survived = np.full(len(new.ids), -1), np.array(new.expressions), {}
    for before, after in pairs:
        ids[after] = last.ids[before]
        survived[int(ids[after])] = float(overlap[before, after])
        if np.abs(expressions[after] - last.expressions[before]).max() <= hold_within:
            expressions[after] = last.expressions[before]
    ids[ids < 0] = next_id + np.arange(np.sum(ids < 0))
    vanished = tuple(int(name) for name in last.ids if int(name) not in survived)
    emerged = tuple(int(name) for name in ids if int(name) not in survived)
    return replace(new, ids=ids, expressions=expressions), ClusterTransition(survived, vanished, emerged)


def _overlap(before: Array, after: Array, k_before: int, k_after: int) -> Array:
    """Jaccard index ``(k_before, k_after)`` of each pair of clusters, from the labels of the same windows."""
    both = np.zeros((k_before, k_after))
    both[np.ix_(np.unique(before), np.unique(after))] = contingency_matrix(before, after)
    either = both.sum(axis=1)[:, None] + both.sum(axis=0) - both
    return np.divide(both, either, out=np.zeros_like(both), where=either > 0)
