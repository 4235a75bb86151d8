"""The estimator: choose a space for changes of the state, cluster them, name each cluster by its instructions."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.metrics import pairwise_distances_argmin
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from ibe_rl.ibe.mapping import ClusterMapping, gap_between, purities_of
from ibe_rl.ibe.meaning import Interpretation, Meaning, UnknownMeaningWarning
from ibe_rl.ibe.settings import OF_INSTRUCTIONS, IBEConfig, check_settings
from ibe_rl.ibe.space import (
    Space,
    TooLittleDataError,
    along,
    consequences,
    information,
    lasso_axes,
    movement_of_one,
    network,
    rule_axes,
    scaled,
)
from ibe_rl.ibe.split import count_distinct, split, split_mirrored, with_rest
from ibe_rl.ibe.vocabulary import normalise
from ibe_rl.types import Array, read_only


class _TrainingSet(NamedTuple):
    """Windows with their weights; states with their instructions; and what is known of the meaning."""

    delta: Array
    instruction: Array
    weight: Array
    heard: tuple[Array, Array] | None
    interpretation: Interpretation | None


class IBEMapping(BaseEstimator):
    """IBE's mapping from changes of the state to expressions.

    The defaults are the paper's (section "Mapping ..."): standardise, k-means, mean instruction of each cluster,
    min-max normalisation over the clusters.

    Args:
        n_clusters: clusters, at least 2, for all numbers of an instruction together; fewer if fewer windows differ.
        space: where changes are clustered. "all": all dimensions, standardised. "information": the same, weighted by
            their mutual information with the instruction. "lasso": the axes of a lasso regression of the instruction
            on the change. "network": the output of a small network with the same targets. "rule": the axes of the
            state on which the instruction depends, see ``rule_axes`` and ``consequences`` in ``ibe_rl.ibe.space``.
        split: clustering algorithm, see ``ibe_rl.ibe.split.split``.
        power: exponent of the magnitude of a movement along the axes. Below 1 small movements get clusters of their
            own. Only with a space of instructions.
        symmetric: make the set of clusters its own mirror image. With normalisation "movement" one pair is at rest.
        normalisation: "minmax" (the paper's) or "sign" of the mean instructions; "movement": a cluster is named by how
            far it moves, in units of what the instruction 1 typically brought about. The last only with a space of
            instructions.
        membership: see ``ClusterMapping``.
        weigh_followed: fit twice. The second time each window is weighted by how well its expression fits its
            instruction.
        dimensions: indices of the state dimensions that count; None takes all.
        hidden: widths of the hidden layers of "network".
        n_init: number of k-means initialisations, the best is kept.
        last: an earlier mapping; k-means is initialised with its centres instead, if it has as many clusters.
        memory: share in [0, 1) that the windows of ``last`` still count, each as one at its cluster's centre. They
            decay with every fit (streaming k-means with a decay factor).
        max_fit_windows: axes and clusters are learnt from at most this many windows, a random sample. Sizes and mean
            instructions are of all of them.
        random_state: seed of the initialisations and of the sample.

    Attributes:
        mapping_: the learnt ``ClusterMapping``.
        meanings_: one ``Meaning`` for each number of an instruction; empty if it was fitted without an interpretation.
        labels_: ``(W,)`` cluster of each window it was fitted on.
    """

    settings = IBEConfig

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
        state_instructions: Array | None = None,
        interpretation: Interpretation | None = None,
    ) -> Self:
        """Learn the vocabulary.

        Args:
            delta: ``(W, S)`` changes of the state from the best episodes.
            instruction: ``(W,)`` or ``(W, d)`` the instruction at the beginning of each window; leave out windows
                without one.
            states: ``(N, S)`` states with an instruction, of good and bad episodes; only "rule" needs them.
            state_instructions: ``(N,)`` or ``(N, d)`` the instructions in these states.
            interpretation: the axes and signs that are meant, from ``interpret``; "rule" then needs neither ``states``
                nor ``state_instructions``. None: signs are read from the windows, on the paper's assumption that the
                best episodes followed the instruction.

        Raises:
            TooLittleDataError: with fewer than two distinct windows, or as the axes.
            ValueError: for invalid or incompatible settings (``check_settings``), lengths that differ, or a ``last``
                with another number of dimensions.

        Warns:
            UnknownMeaningWarning: for each number of the instruction whose meaning is not known.
        """
        check_settings(self)
        heard: tuple[Array, Array] | None = None
        if states is not None and state_instructions is not None:
            heard = np.asarray(states, float), _columns(state_instructions)
        data = _TrainingSet(np.asarray(delta, float), _columns(instruction), np.ones(len(delta)), heard, interpretation)
        self._check_data(data)
        self.mapping_, self.labels_ = self._learn(data)
        if self.weigh_followed:
            missed = np.abs(self.mapping_.express(data.delta) - data.instruction).max(axis=1)
            followed = np.clip(1 - missed, 0.05, 1)  # above 0, so that no value of the instruction vanishes
            self.mapping_, self.labels_ = self._learn(data._replace(weight=followed))
        self.meanings_ = self.mapping_.meanings
        for number, meaning in enumerate(self.meanings_):
            if not meaning.known:
                reason = f"the meaning of component {number} of the instruction is unknown: {meaning.reason}"
                warnings.warn(reason, UnknownMeaningWarning, stacklevel=2)
        return self

    def predict(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to expressions ``(W, d)``."""
        check_is_fitted(self)
        return self.mapping_.express(delta)

    def _check_data(self, data: _TrainingSet) -> None:
        if self.space == "rule" and data.heard is None and data.interpretation is None:
            raise ValueError("space='rule': needs states and state_instructions, or an interpretation")
        if len(data.delta) != len(data.instruction):
            raise ValueError(f"{len(data.delta)} windows but {len(data.instruction)} instructions")
        if not len(data.delta):
            raise TooLittleDataError(f"0 distinct windows for n_clusters={self.n_clusters}")
        if self.last is not None:
            places = data.instruction if self.space in OF_INSTRUCTIONS else data.delta
            read_only(self.last.centres, (None, places.shape[1]), "last")
            read_only(self.last.space.mean, data.delta.shape[1:], "last.space.mean")

    def _learn(self, data: _TrainingSet) -> tuple[ClusterMapping, Array]:
        random = np.random.default_rng(self.random_state)
        rows = random.permutation(len(data.delta))[: self.max_fit_windows]
        seed = int(random.integers(2**31))
        space = self._space(data, rows, seed)
        places = space.place(data.delta)
        centres = self._split(places[rows], data.weight[rows] * len(places) / len(rows), space, seed)
        return self._name(data, places, centres, space)

    def _space(self, data: _TrainingSet, rows: Array, seed: int) -> Space:
        delta, instruction = data.delta[rows], data.instruction[rows]
        kept = np.isin(np.arange(delta.shape[1]), range(delta.shape[1]) if self.dimensions is None else self.dimensions)
        if self.space == "all":
            mean, weight = self._standard(data.delta)
            return scaled(mean, weight * kept)
        if self.space == "information":
            scaler = StandardScaler().fit(data.delta)
            return scaled(scaler.mean_, information(delta, instruction, seed) * kept / scaler.scale_)
        if self.space == "network":
            return network(delta, instruction, kept, self.hidden, seed)
        if self.space == "lasso":
            axes = lasso_axes(delta, instruction, seed) * kept[:, None]
        else:
            axes = consequences(self._rule_axes(data, delta, seed) * kept[:, None], delta, instruction)
        return along(axes / self._unit(data, axes), self.power)

    def _rule_axes(self, data: _TrainingSet, delta: Array, seed: int) -> Array:
        if data.interpretation is not None:
            for axis, meaning in zip(data.interpretation.axes.T, data.interpretation.meanings, strict=True):
                if not np.any(axis):
                    raise TooLittleDataError(meaning.reason)
            return data.interpretation.axes
        assert data.heard is not None
        states, state_instructions = data.heard
        some = np.random.default_rng(seed).permutation(len(states))[: self.max_fit_windows]
        return rule_axes(states[some], state_instructions[some], seed, np.ptp(delta, axis=0) > 0)

    def _meanings(self, data: _TrainingSet) -> tuple[Meaning, ...]:
        """Axes of "rule" have the sign that is meant; other spaces take the sign of the mean instruction."""
        if data.interpretation is None:
            return ()
        found = data.interpretation.meanings
        return found if self.space == "rule" else tuple(one.as_the_best_did() for one in found)

    def _standard(self, delta: Array) -> tuple[Array, Array]:
        """Mean and 1 / standard deviation of the dimensions, averaged with those of ``last``."""
        scaler = StandardScaler().fit(delta)
        mean, variance = scaler.mean_, scaler.scale_**2
        if self.last is not None:
            new, before = self._new_share(len(delta)), np.diag(self.last.space.weights[0])
            earlier = np.divide(1, before, out=np.ones_like(mean), where=before > 0) ** 2
            mean, variance = (1 - new) * self.last.space.mean + new * mean, (1 - new) * earlier + new * variance
        return mean, 1 / np.sqrt(variance)

    def _unit(self, data: _TrainingSet, axes: Array) -> Array:
        """How far the instruction 1 moves along the axes ``(S, d)``, averaged with the unit of ``last``."""
        known = np.zeros(axes.shape[1], bool)
        if self.space == "rule" and data.interpretation is not None:
            known = np.array([one.known for one in data.interpretation.meanings])
        moved = movement_of_one(data.delta @ axes, data.instruction, data.weight, known)
        if self.last is None:
            return moved
        new, d = self._new_share(len(data.delta)), len(moved)
        before = np.diag(self.last.space.change_at(np.eye(d)) @ axes)
        same_way = before * moved > 0  # a past in which the instruction had the other sign does not count
        return np.where(same_way, new * moved + (1 - new) * before, moved)

    def _new_share(self, windows: int) -> float:
        assert self.last is not None
        return float(windows / (windows + self.memory * self.last.evidence.sum()))

    def _split(self, places: Array, counts: Array, space: Space, seed: int) -> Array:
        k, first = min(self.n_clusters, count_distinct(places, self.symmetric)), None
        if k < 2:
            raise TooLittleDataError(f"{k} distinct windows for n_clusters={self.n_clusters}: at least 2 are needed")
        if self.last is not None:
            first = space.place(self.last.centre_changes())
            places, counts = np.concatenate([places, first]), np.append(counts, self.memory * self.last.evidence)
            first = first if len(first) == k else None
        divide = split_mirrored if self.symmetric else split
        found = divide(places, counts, k, self.split, self.n_init, first, seed)
        return with_rest(found, self.power) if self.symmetric and self.normalisation == "movement" else found

    def _name(self, data: _TrainingSet, places: Array, centres: Array, space: Space) -> tuple[ClusterMapping, Array]:
        """The mapping with its mean instructions (the paper's equations 3 to 5) and expressions; and labels."""
        k = len(centres)
        labels = pairwise_distances_argmin(places, centres)
        sizes = np.bincount(labels, minlength=k)
        evidence = np.bincount(labels, data.weight, k)
        sums = np.stack([np.bincount(labels, data.weight * column, k) for column in data.instruction.T], axis=1)
        if self.last is not None:
            remembered = self.memory * self.last.evidence
            earlier = pairwise_distances_argmin(space.place(self.last.centre_changes()), centres)
            np.add.at(evidence, earlier, remembered)
            np.add.at(sums, earlier, remembered[:, None] * self.last.mean_instructions)
        overall = data.instruction.mean(axis=0)
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
            purities=purities_of(labels, sizes, data.instruction)[order],
            evidence=evidence[order],
            ids=np.arange(k),
            membership=self.membership,
            width=gap_between(centres),
            meanings=self._meanings(data),
        )
        return named, np.argsort(order)[labels]


def _columns(instruction: Array) -> Array:
    instruction = np.asarray(instruction, float)
    return instruction[:, None] if instruction.ndim == 1 else instruction
