"""Negative controls: vocabularies and predictions that cannot be right, to see how each metric scores them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sklearn.metrics import pairwise_distances_argmin

from ibe_rl.evaluation.moments import Moments
from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.meaning import Meaning
from ibe_rl.ibe.space import Space, scaled
from ibe_rl.ibe.vocabulary import normalise
from ibe_rl.ibe.word_meaning import moves_of
from ibe_rl.types import Array, Episode, ExpressionMapping

DRAWN = 10_000
"""Most windows in which distinct ones are looked for."""


@dataclass(frozen=True)
class Flipped:
    """A vocabulary with every expression negated."""

    mapping: ExpressionMapping

    @property
    def meanings(self) -> Sequence[Meaning]:
        """Those of the vocabulary; empty if it has none."""
        return getattr(self.mapping, "meanings", ())

    @property
    def ids(self) -> Array:
        """See ``ibe_rl.types.Mapping``."""
        return self.mapping.ids

    def cluster(self, delta: Array) -> Array:
        """See ``ibe_rl.types.Mapping``."""
        return self.mapping.cluster(delta)

    def express(self, delta: Array) -> Array:
        """See ``ibe_rl.types.Mapping``; the share of the fittest word becomes that of the least fit."""
        expressions = self.mapping.express(delta)
        if moves_of(self.meanings) is None:
            return -expressions
        return expressions.max(axis=1, keepdims=True) + expressions.min(axis=1, keepdims=True) - expressions

    def movement(self, delta: Array) -> Array:
        """See ``ClusterMapping``."""
        if isinstance(self.mapping, ClusterMapping) and self.mapping.membership == "graded":
            return -self.mapping.movement(delta)
        return self.express(delta)

    def knows(self, delta: Array) -> Array:
        """See ``ibe_rl.types.Mapping``."""
        return self.mapping.knows(delta)

    def confidence(self, delta: Array) -> Array:
        """See ``ibe_rl.types.Mapping``."""
        return self.mapping.confidence(delta)


def random_clusters(windows: Windows, n_clusters: int, random: np.random.Generator, count: int) -> list[ClusterMapping]:
    """``count`` vocabularies, each with ``k`` randomly drawn windows as cluster centres, in standardised units.

    The rest is as in the paper: the mean instruction of each cluster, min-max scaled over the clusters.
    """
    spread = windows.delta.std(axis=0)
    space = scaled(windows.delta.mean(axis=0), 1 / np.where(spread > 0, spread, 1))
    places = space.place(windows.delta)
    told, kinds = np.unique(windows.instruction, axis=0, return_inverse=True)
    return [_around(_drawn(places, n_clusters, random), space, places, told, kinds.ravel()) for _ in range(count)]


def _drawn(places: Array, n_clusters: int, random: np.random.Generator) -> Array:
    """At most ``n_clusters`` distinct places."""
    drawn = places[random.permutation(len(places))[:DRAWN]]
    return drawn[np.sort(np.unique(drawn, axis=0, return_index=True)[1])[:n_clusters]]


def _around(centres: Array, space: Space, places: Array, told: Array, kinds: Array) -> ClusterMapping:
    """The vocabulary of ``k`` centres; the window at each of the ``N`` places was told ``told[kind]``."""
    k, labels = len(centres), pairwise_distances_argmin(places, centres)
    counted = np.bincount(labels * len(told) + kinds, minlength=k * len(told)).reshape(k, -1)
    sizes = counted.sum(axis=1)
    counts = np.maximum(sizes, 1)
    means = counted @ told / counts[:, None]
    return ClusterMapping(
        space, centres, means, normalise(means), sizes, counted.max(axis=1) / counts, sizes, np.arange(k)
    )


def dealt(mapping: ClusterMapping, random: np.random.Generator) -> ClusterMapping:
    """The same clusters with their expressions permuted at random."""
    order = random.permutation(len(mapping.expressions))
    return replace(mapping, expressions=mapping.expressions[order], membership="hard")


def shuffle_instructions(
    best: Sequence[Episode], heard: Sequence[Episode], random: np.random.Generator
) -> tuple[list[Episode], list[Episode]]:
    """Give each episode the instructions of another one, by a permutation within each of the two lists.

    Their order is kept; where the other episode is shorter, its last instruction is repeated.
    """
    return _shuffle(best, random), _shuffle(heard, random)


def _shuffle(episodes: Sequence[Episode], random: np.random.Generator) -> list[Episode]:
    return [
        _with_instructions_of(episode, episodes[other])
        for episode, other in zip(episodes, random.permutation(len(episodes)), strict=True)
    ]


def _with_instructions_of(episode: Episode, other: Episode) -> Episode:
    steps = np.minimum(np.arange(len(episode)), len(other) - 1)
    return replace(episode, instructions=other.instructions[steps], given=other.given[steps])


def of_another_moment(moments: Moments, random: np.random.Generator) -> Moments:
    """Give each moment the predictions of a random moment of another episode.

    Raises:
        ValueError: if all moments are of one episode.
    """
    names, episode = np.unique(moments.episode, return_inverse=True)
    if len(names) < 2:
        raise ValueError("moments of at least two episodes are needed")
    order = random.permutation(len(names))
    other = np.empty(len(names), int)
    other[order] = np.roll(order, 1)  # a cycle through all episodes: none gets its own
    counts = np.bincount(episode)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    sorted_rows = np.argsort(episode, kind="stable")
    given_by = other[episode]
    drawn = starts[given_by] + (random.random(len(moments)) * counts[given_by]).astype(int)
    rows = sorted_rows[drawn]
    return replace(moments, predicted=moments.predicted[rows], trusted=moments.trusted[rows])
