"""A learnt vocabulary: clusters of changes of the state, with an expression for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.special import softmax
from sklearn.metrics import pairwise_distances

from ibe_rl.ibe.meaning import Meaning, sayable
from ibe_rl.ibe.space import Space
from ibe_rl.types import Array, Explanation, ExpressionMapping, read_only

MEMBERSHIPS = ("hard", "soft", "direct", "graded")


@dataclass(frozen=True)
class ClusterMapping:
    """f: change of the state to expression.

    Attributes:
        space: the space that changes are clustered in.
        centres: ``(k, P)`` cluster centres in it.
        mean_instructions: ``(k, d)`` e^i.
        expressions: ``(k, d)`` m^i in [-1, 1]; clusters are sorted by its first number.
        sizes: ``(k,)`` number of training windows in each cluster.
        purities: ``(k,)`` share of a cluster's windows that carry its most frequent instruction.
        evidence: ``(k,)`` effective number of windows that the mean instructions stand on, earlier ones included.
        ids: ``(k,)`` int, ids of the clusters that last over refreshes (``ibe_rl.ibe.identity``).
        membership: "hard": the expression of the nearest cluster; "soft": the mean of all expressions with Gaussian
            weights; "direct": the place itself is the expression (``P`` equals ``d``); "graded": the expression is
            hard, and ``movement`` direct.
        width: standard deviation of these weights, in units of the space.
        meanings: one for each number of an expression; empty: learnt without an interpretation, all count as known.
    """

    space: Space
    centres: Array
    mean_instructions: Array
    expressions: Array
    sizes: Array
    purities: Array
    evidence: Array
    ids: Array
    membership: str = "hard"
    width: float = 1.0
    meanings: tuple[Meaning, ...] = ()

    def __post_init__(self) -> None:
        k, places = np.shape(self.centres)
        shapes: dict[str, tuple[int | None, ...]] = {
            "centres": (k, self.space.size),
            "mean_instructions": (k, None),
            "expressions": (k, places if self.membership in ("direct", "graded") else None),
            **dict.fromkeys(("sizes", "purities", "evidence", "ids"), (k,)),
        }
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), np.int64 if name == "ids" else np.float64)
            object.__setattr__(self, name, read_only(values, shape, name))
        if self.membership not in MEMBERSHIPS or not self.width > 0:
            raise ValueError(f"membership {self.membership!r} of width {self.width}: choose {', '.join(MEMBERSHIPS)}")
        if len(self.meanings) not in (0, np.shape(self.expressions)[1]):
            raise ValueError(f"{len(self.meanings)} meanings for {np.shape(self.expressions)[1]} numbers")

    def cluster(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to cluster indices ``(W,)``."""
        places = self.space.place(delta)
        nearest: Array = np.argmin(np.square(self.centres).sum(axis=1) - 2 * places @ self.centres.T, axis=1)
        return nearest  # sklearn's pairwise_distances_argmin takes .2 ms for one change, which is asked at every step

    def express(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)``: the paper's equation 2, unless ``membership`` differs."""
        if self.membership in ("hard", "graded"):
            return self.expressions[self.cluster(delta)]
        places = self.space.place(delta)
        if self.membership == "direct":
            return self._along(places)
        near = softmax(-((pairwise_distances(places, self.centres) / self.width) ** 2) / 2, axis=1)
        return near @ self.expressions

    def movement(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to numbers ``(W, d)`` beside the words, finer than ``express`` if it is graded."""
        return self._along(self.space.place(delta)) if self.membership == "graded" else self.express(delta)

    def _along(self, places: Array) -> Array:
        return np.clip(self.space.spread_out(places), -1, 1)

    def knows(self, delta: Array) -> Array:
        """For which changes ``(W, S)`` the meaning of the expression is known, ``(W,)`` bool."""
        return sayable(self.express(delta), self.meanings)

    def confidence(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to the purities ``(W,)`` of their clusters; not calibrated."""
        return self.purities[self.cluster(delta)]

    def centre_changes(self) -> Array:
        """The centres ``(k, S)`` as changes of the state; ``(0, S)`` if the space is not linear."""
        return self.space.change_at(self.centres) if self.space.linear else np.empty((0, len(self.space.mean)))

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        kind = {"membership": self.membership, "width": self.width}
        return {"space": self.space.to_dict(), **arrays, **kind, "meanings": [one.to_dict() for one in self.meanings]}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``; raises ValueError if a value is missing or a shape does not fit."""
        try:
            arrays: dict[str, Any] = {name: np.asarray(values[name], float) for name in _ARRAYS}
            if not all(np.isfinite(array).all() for array in arrays.values()):
                raise ValueError("the mapping is damaged: not all of its numbers are finite")
            space, membership, width = Space.from_dict(values["space"]), values["membership"], values["width"]
            meanings = tuple(Meaning.from_dict(each) for each in values.get("meanings", ()))
            return cls(space, **arrays, membership=str(membership), width=float(width), meanings=meanings)
        except KeyError as error:
            raise ValueError(f"the mapping lacks {error}") from None
        except (TypeError, OverflowError) as error:
            raise ValueError(f"the mapping is damaged: {error}") from None


_ARRAYS = ("centres", "mean_instructions", "expressions", "sizes", "purities", "evidence", "ids")


def mean_movements(mapping: ExpressionMapping, deltas: Array) -> Array:
    """The mean ``(N, d)`` over the futures of ``movement``, or else ``express``, of changes ``(N, F, S)``."""
    count, futures, size = deltas.shape
    movement = getattr(mapping, "movement", mapping.express)
    mean: Array = movement(deltas.reshape(-1, size)).reshape(count, futures, -1).mean(axis=1)
    return mean


def movements_said(said: Sequence[Explanation]) -> Array:
    """The numbers ``(N, d)`` beside the phrases of explanations."""
    return np.array([one.expression if one.movement is None else one.movement for one in said], float)


def gap_between(centres: Array) -> float:
    """Median distance between nearest centres; 1 if that is 0."""
    apart = pairwise_distances(centres)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1))) or 1.0


def purities_of(labels: Array, sizes: Array, instruction: Array) -> Array:
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
