"""Learn a vocabulary: find where to compare changes of the state, divide them, say what each cluster is called."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.metrics import pairwise_distances_argmin
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from ibe_rl.ibe.interpret import Interpretation
from ibe_rl.ibe.mapping import ClusterMapping, gap_between, purities_of
from ibe_rl.ibe.meaning import Meaning, UnknownMeaningWarning
from ibe_rl.ibe.movement import movement_of_one
from ibe_rl.ibe.settings import OF_INSTRUCTIONS, check_settings
from ibe_rl.ibe.space import (
    Space,
    TooLittleDataError,
    along,
    consequences,
    information,
    lasso_axes,
    network,
    rule_axes,
    scaled,
)
from ibe_rl.ibe.split import split, split_mirrored, with_rest
from ibe_rl.ibe.vocabulary import normalise
from ibe_rl.types import Array, read_only


class _Lessons(NamedTuple):
    """Changes, instructions and how much each window counts; what was heard and what is known of its meaning."""

    delta: Array
    instruction: Array
    weight: Array
    heard: tuple[Array, Array] | None
    interpretation: Interpretation | None


class IBEMapping(BaseEstimator):
    """IBE's mapping from changes of the state to expressions; as it stands, the paper's (section "Mapping ...").

    The paper's: standardise, k-means, mean instruction per cluster, min-max between the clusters.

    Args:
        n_clusters: k, at least 2; of all numbers of an instruction together.
        space: where changes are compared. "all" dimensions, standardised; "information": the same, times their mutual
            information with the instruction; "lasso": along the sparse linear regression of the instruction on the
            change; "network": along a small network's; "rule": along the axes on which the instructor's choice of
            words turns, see ``rule_axes`` and ``consequences`` in ``ibe_rl.ibe.space``.
        split: see ``ibe_rl.ibe.split.split``.
        power: of the magnitude of a movement along the axes; below 1 small movements get clusters of their own. Only
            with a space of instructions.
        symmetric: divide movements and their opposites alike (in all numbers); with "movement" one pair is at rest.
        normalisation: "minmax" (literal) or "sign" of the mean instructions; "movement": a cluster is called by how
            far it moves, 1 being what the instruction 1 typically brought about. Only with a space of instructions.
        membership: see ``ClusterMapping``.
        weigh_followed: fit twice, the second time each window by how well what it is then called fits what was told.
        dimensions: indices of the state dimensions that count; None takes all.
        hidden: widths of the layers of "network".
        n_init: k-means starts, the best is kept.
        last: an earlier mapping: k-means starts from its centres instead.
        memory: share in [0, 1) that the windows ``last`` stands on still count, each as one at its cluster's
            centre; what it remembered itself fades likewise (streaming k-means with a decay factor).
        max_fit_windows: clusters and axes are learnt from at most this many windows, drawn at random; sizes and mean
            instructions are of all of them.
        random_state: seed of the starts and of the draw.

    Attributes:
        mapping_: the learnt ``ClusterMapping``.
        meanings_: what is known of the words, one ``Meaning`` for each number of an instruction; a warning says which
            cannot be told.
        labels_: ``(W,)`` clusters of the windows it was fitted on.
    """

    def __init__(
        self,
        n_clusters: int = 8,
        space: str = "all",
        split: str = "kmeans",
        power: float = 1.0,
        symmetric: bool = False,
        normalisation: str = "minmax",
        membership: str = "hard",
        weigh_followed: bool = False,
        dimensions: Sequence[int] | None = None,
        hidden: Sequence[int] = (32, 32),
        n_init: int = 4,
        last: ClusterMapping | None = None,
        memory: float = 0.0,
        max_fit_windows: int = 20_000,
        random_state: int | None = None,
    ):
        self.n_clusters = n_clusters
        self.space = space
        self.split = split
        self.power = power
        self.symmetric = symmetric
        self.normalisation = normalisation
        self.membership = membership
        self.weigh_followed = weigh_followed
        self.dimensions = dimensions
        self.hidden = hidden
        self.n_init = n_init
        self.last = last
        self.memory = memory
        self.max_fit_windows = max_fit_windows
        self.random_state = random_state

    def fit(
        self,
        delta: Array,
        instruction: Array,
        states: Array | None = None,
        told: Array | None = None,
        interpretation: Interpretation | None = None,
    ) -> Self:
        """Learn the vocabulary.

        Args:
            delta: ``(W, S)`` changes of the state from the best episodes.
            instruction: ``(W,)`` or ``(W, d)`` the instruction at the beginning of each window; windows
                without one must be left out.
            states: ``(N, S)`` states in which the instructor spoke, of good and of bad episodes; "rule" reads them.
            told: ``(N,)`` or ``(N, d)`` what was said in them.
            interpretation: which way the words are meant, from ``interpret``; "rule" compares changes along its axes,
                and needs neither ``states`` nor ``told`` then. None: which way is read from the windows alone, on the
                paper's assumption that these are of episodes in which the instruction was followed, which nobody has
                tested.

        Raises:
            TooLittleDataError: with fewer distinct windows than clusters, or as the axes.
            ValueError: for settings that do not exist or do not go together (``check_settings``), if the lengths
                differ, or if ``last`` has another number of clusters or dimensions.
        """
        check_settings(self)
        heard = None if states is None or told is None else (np.asarray(states, float), _columns(told))
        arrays = np.asarray(delta, float), _columns(instruction), np.ones(len(delta))
        lessons = _Lessons(*arrays, heard, interpretation)
        if self.space == "rule" and heard is None and interpretation is None:
            raise ValueError("space='rule': needs states and told, or an interpretation")
        if len(lessons.delta) != len(lessons.instruction):
            raise ValueError(f"{len(lessons.delta)} windows but {len(lessons.instruction)} instructions")
        if not len(delta):
            raise TooLittleDataError(f"0 distinct windows for n_clusters={self.n_clusters}")
        if self.last is not None:
            places = lessons.instruction if self.space in OF_INSTRUCTIONS else lessons.delta
            read_only(self.last.centres, (self.n_clusters, places.shape[1]), "last")
            read_only(self.last.space.mean, lessons.delta.shape[1:], "last.space.mean")
        self.mapping_, self.labels_ = self._learn(lessons)
        if self.weigh_followed:
            missed = np.abs(self.mapping_.express(lessons.delta) - lessons.instruction).max(axis=1)
            followed = np.clip(1 - missed, 0.05, 1)  # nobody is left out: a class must not vanish
            self.mapping_, self.labels_ = self._learn(lessons._replace(weight=followed))
        self.meanings_ = self.mapping_.meanings
        for number, meaning in enumerate(self.meanings_):
            if not meaning.known:
                reason = f"what number {number} of the instruction means cannot be told: {meaning.reason}"
                warnings.warn(reason, UnknownMeaningWarning, stacklevel=2)
        return self

    def predict(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)``."""
        check_is_fitted(self)
        return self.mapping_.express(delta)

    def _learn(self, lessons: _Lessons) -> tuple[ClusterMapping, Array]:
        random = np.random.default_rng(self.random_state)
        rows = random.permutation(len(lessons.delta))[: self.max_fit_windows]
        seed = int(random.integers(2**31))
        space = self._space(lessons, rows, seed)
        places = space.place(lessons.delta)
        centres = self._split(places[rows], lessons.weight[rows] * len(places) / len(rows), space, seed)
        return self._name(lessons, places, centres, space)

    def _space(self, lessons: _Lessons, rows: Array, seed: int) -> Space:
        delta, told = lessons.delta[rows], lessons.instruction[rows]
        kept = np.isin(np.arange(delta.shape[1]), range(delta.shape[1]) if self.dimensions is None else self.dimensions)
        if self.space == "all":
            mean, weight = self._standard(lessons.delta)
            return scaled(mean, weight * kept)
        if self.space == "information":
            scaler = StandardScaler().fit(lessons.delta)
            return scaled(scaler.mean_, information(delta, told, seed) * kept / scaler.scale_)
        if self.space == "network":
            return network(delta, told, kept, self.hidden, seed)
        if self.space == "lasso":
            axes = lasso_axes(delta, told, seed) * kept[:, None]
        else:
            axes = consequences(self._rule_axes(lessons, delta, seed) * kept[:, None], delta, told)
        return along(axes / self._unit(lessons, axes), self.power)

    def _rule_axes(self, lessons: _Lessons, delta: Array, seed: int) -> Array:
        if lessons.interpretation is not None:
            for axis, meaning in zip(lessons.interpretation.axes.T, lessons.interpretation.meanings, strict=True):
                if not np.any(axis):
                    raise TooLittleDataError(meaning.reason)
            return lessons.interpretation.axes
        assert lessons.heard is not None
        states, told = lessons.heard
        some = np.random.default_rng(seed).permutation(len(states))[: self.max_fit_windows]
        return rule_axes(states[some], told[some], seed, np.ptp(delta, axis=0) > 0)

    def _meanings(self, lessons: _Lessons) -> tuple[Meaning, ...]:
        """What is known of the words; names by the mean instruction mean the opposite where the best did not follow."""
        if lessons.interpretation is None:
            return ()
        found = lessons.interpretation.meanings
        return found if self.space == "rule" else tuple(one.as_the_best_did() for one in found)

    def _standard(self, delta: Array) -> tuple[Array, Array]:
        """Mean, and 1 / standard deviation of the dimensions; those of ``last`` count as remembered."""
        scaler = StandardScaler().fit(delta)
        mean, variance = scaler.mean_, scaler.scale_**2
        if self.last is not None:
            new, before = self._new_share(len(delta)), np.diag(self.last.space.weights[0])
            earlier = np.divide(1, before, out=np.ones_like(mean), where=before > 0) ** 2
            mean, variance = (1 - new) * self.last.space.mean + new * mean, (1 - new) * earlier + new * variance
        return mean, 1 / np.sqrt(variance)

    def _unit(self, lessons: _Lessons, axes: Array) -> Array:
        """How far along the axes ``(S, d)`` the instruction 1 moves; what ``last`` took it for counts as remembered."""
        meanings = self._meanings(lessons) if self.space == "rule" else ()
        moved = movement_of_one(lessons.delta @ axes, lessons.instruction, lessons.weight, meanings)
        if self.last is None:
            return moved
        new, d = self._new_share(len(lessons.delta)), len(moved)
        before = np.diag(self.last.space.change_at(np.eye(d)) @ axes)
        same_way = before * moved > 0  # once the instruction means the opposite, the past says nothing
        return np.where(same_way, new * moved + (1 - new) * before, moved)

    def _new_share(self, windows: int) -> float:
        assert self.last is not None
        return float(windows / (windows + self.memory * self.last.evidence.sum()))

    def _split(self, places: Array, counts: Array, space: Space, seed: int) -> Array:
        distinct = len(np.unique(places, axis=0))
        if distinct < self.n_clusters:
            raise TooLittleDataError(f"{distinct} distinct windows for n_clusters={self.n_clusters}")
        first = None
        if self.last is not None:
            first = space.place(self.last.centre_changes())
            places, counts = np.concatenate([places, first]), np.append(counts, self.memory * self.last.evidence)
        divide = split_mirrored if self.symmetric else split
        found = divide(places, counts, self.n_clusters, self.split, self.n_init, first, seed)
        return with_rest(found, self.power) if self.symmetric and self.normalisation == "movement" else found

    def _name(self, lessons: _Lessons, places: Array, centres: Array, space: Space) -> tuple[ClusterMapping, Array]:
        """Give each cluster the mean of its instructions (the paper's equations 3 to 5) and its name; and labels."""
        k = len(centres)
        labels = pairwise_distances_argmin(places, centres)
        sizes = np.bincount(labels, minlength=k)
        evidence = np.bincount(labels, lessons.weight, k)
        sums = np.stack([np.bincount(labels, lessons.weight * told, k) for told in lessons.instruction.T], axis=1)
        if self.last is not None:
            remembered = self.memory * self.last.evidence
            earlier = pairwise_distances_argmin(space.place(self.last.centre_changes()), centres)
            np.add.at(evidence, earlier, remembered)
            np.add.at(sums, earlier, remembered[:, None] * self.last.mean_instructions)
        overall = lessons.instruction.mean(axis=0)
        means = np.where(evidence[:, None] > 0, sums / np.maximum(evidence, 1e-9)[:, None], overall)
        moves = np.clip(space.spread_out(centres), -1, 1)
        expressions = moves if self.normalisation == "movement" else normalise(means, self.normalisation)
        order = np.lexsort((means[:, 0], expressions[:, 0]))
        named = ClusterMapping(
            space,
            centres[order],
            mean_instructions=means[order],
            expressions=expressions[order],
            sizes=sizes[order],
            purities=purities_of(labels, sizes, lessons.instruction)[order],
            evidence=evidence[order],
            ids=np.arange(k),
            membership=self.membership,
            width=gap_between(centres),
            meanings=self._meanings(lessons),
        )
        return named, np.argsort(order)[labels]


def _columns(instruction: Array) -> Array:
    instruction = np.asarray(instruction, float)
    return instruction[:, None] if instruction.ndim == 1 else instruction
