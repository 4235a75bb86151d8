"""Where changes of the state are compared: all dimensions alike, or the axes that the instructions speak of."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.feature_selection import mutual_info_classif
from sklearn.linear_model import LassoCV, LogisticRegression, Ridge
from sklearn.neural_network import MLPRegressor
from sklearn.preprocessing import StandardScaler

from ibe_rl.types import Array, read_only

MOST_CLASSES = 10
"""With more distinct values an instruction counts as a number on a scale, not as one of a few things to say."""

SPARSEST_FIRST, AS_ACCURATE = (0.4, 0.2, 0.1), 0.025
"""Dimensions with less than such a share of the largest coefficient are left out if the rule is told as exactly.

Mistakes of the instructor give every dimension some of the rule: with a fifth of them wrong, leaving such dimensions
out cost up to .022; a dimension that what is said does depend on cost .07 (docs/INSTRUCTION.md).
"""

FEWEST_WINDOWS = 20
"""Some are held out to see when a regression is good enough."""


class TooLittleDataError(ValueError):
    """The windows cannot carry a vocabulary yet; the message says what is missing."""


@dataclass(frozen=True)
class Space:
    """Changes of the state ``(W, S)`` to places ``(W, P)``: shift, layers with ReLU between them, then a root.

    Attributes:
        mean: ``(S,)`` taken off a change, in observation units.
        weights: one matrix a layer, the first ``(S, ...)``, the last ``(..., P)``; a single one is a linear space.
        biases: one vector a layer.
        power: of the magnitude of each place, its sign kept; below 1 small changes take up more room.
    """

    mean: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    power: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", read_only(np.asarray(self.mean, float), (None,), "mean"))
        inside: int | None = len(self.mean)
        if not len(self.weights) or len(self.weights) != len(self.biases) or not self.power > 0:
            raise ValueError(f"{len(self.weights)} weights, {len(self.biases)} biases, power {self.power}: not a space")
        layers = []
        for weights, bias in zip(self.weights, self.biases, strict=True):
            matrix = read_only(np.asarray(weights, float), (inside, None), "weights")
            inside = matrix.shape[1]
            layers.append((matrix, read_only(np.asarray(bias, float), (inside,), "biases")))
        for name, arrays in zip(("weights", "biases"), zip(*layers, strict=True), strict=True):
            object.__setattr__(self, name, arrays)

    @property
    def size(self) -> int:
        """``P``."""
        return len(self.biases[-1])

    @property
    def linear(self) -> bool:
        """True if a place says which change it stands for."""
        return len(self.weights) == 1

    def place(self, delta: Array) -> Array:
        """Changes ``(W, S)`` to places ``(W, P)``."""
        values = np.asarray(delta, float) - self.mean
        for layer, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            values = values @ weights + bias
            if layer + 1 < len(self.weights):
                values = np.maximum(values, 0)
        return signed_power(values, self.power)

    def spread_out(self, places: Array) -> Array:
        """Undo the root only."""
        return signed_power(places, 1 / self.power)

    def change_at(self, places: Array) -> Array:
        """The smallest changes ``(k, S)`` from the mean that lie at places ``(k, P)``, in a linear space."""
        return self.mean + (self.spread_out(places) - self.biases[0]) @ np.linalg.pinv(self.weights[0])

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        layers = [{"weights": w.tolist(), "bias": b.tolist()} for w, b in zip(self.weights, self.biases, strict=True)]
        return {"mean": self.mean.tolist(), "layers": layers, "power": self.power}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``.

        Raises:
            ValueError: if a value is missing or shapes do not fit.
        """
        try:
            layers = values["layers"]
            weights = tuple(np.asarray(layer["weights"], float) for layer in layers)
            biases = tuple(np.asarray(layer["bias"], float) for layer in layers)
            mean, power = np.asarray(values["mean"], float), float(values["power"])
            if not all(np.isfinite(numbers).all() for numbers in (mean, np.array(power), *weights, *biases)):
                raise ValueError("the space is damaged: not all of its numbers are finite")
            return cls(mean, weights, biases, power)
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f"the space is damaged: {error}") from None


def signed_power(values: Array, power: float) -> Array:
    """Raise the magnitudes to a power and keep the signs."""
    raised: Array = values if power == 1 else np.sign(values) * np.abs(values) ** power
    return raised


def scaled(mean: Array, weight: Array) -> Space:
    """Each dimension by itself: ``mean`` ``(S,)`` off, times ``weight`` ``(S,)``."""
    return Space(mean, (np.diag(weight),), (np.zeros(len(weight)),))


def along(axes: Array, power: float = 1.0) -> Space:
    """The axes ``(S, d)`` only; no change stays no change."""
    return Space(np.zeros(len(axes)), (axes,), (np.zeros(axes.shape[1]),), power)


def rule_axes(states: Array, told: Array, seed: int, moving: Array | None = None) -> Array:
    """Along which axes of the state the instructor changes what they say.

    What is said depends on the state: a logistic regression of each number of the instruction on the state finds
    the direction in which it turns from one value to the next. Moving along it is what the instruction is about,
    whatever the axes of the state are called or measured in; which way is not known from this.

    Args:
        states: ``(N, S)`` states in which something was said, of good and of bad episodes.
        told: ``(N, d)`` what was said.
        seed: of the solver.
        moving: ``(S,)`` bool, dimensions that change at all; on an axis without any of them nothing could be told
            apart. None: all.

    Returns:
        ``(S, d)``, in 1 / observation units.

    Raises:
        TooLittleDataError: if one of the numbers never changed.
    """
    scaler = StandardScaler().fit(states)
    standard = scaler.transform(states)
    can_move = np.ones(states.shape[1], bool) if moving is None else moving
    axes = [_turns(standard, column, can_move, seed) for column in told.T]
    return np.stack(axes, axis=1) / scaler.scale_[:, None]


def consequences(axes: Array, delta: Array, instruction: Array) -> Array:
    """Leave out of each axis the dimensions that move the same way whether told to go up it or down.

    What is said can depend on more than it is about: how fast to sink, on the height. The height falls whatever is
    said, so it is a condition of the instruction and no consequence. The axis of a single number stays as it is: its
    words do not depend on which axes the state is given in.

    Args:
        axes: ``(S, d)``.
        delta: ``(W, S)``.
        instruction: ``(W, d)``.

    Returns:
        ``(S, d)``; an axis is left as it is if nothing on it moves both ways, or only one way was ever told.
    """
    kept = np.array(axes)
    if len(kept.T) == 1:
        return kept
    for axis, told in zip(kept.T, instruction.T, strict=True):
        if (told > 0).any() and (told < 0).any():
            both_ways = delta[told > 0].mean(axis=0) * delta[told < 0].mean(axis=0) < 0
            if np.any(axis * both_ways):
                axis[:] = np.where(both_ways | (np.ptp(delta, axis=0) == 0), axis, 0)
    return kept


def _turns(standard: Array, told: Array, moving: Array, seed: int) -> Array:
    """The direction ``(S,)`` in which one number of the instruction rises, over as few dimensions as explain it."""
    values, kinds = np.unique(told, return_inverse=True)
    if len(values) < 2:
        raise TooLittleDataError(f"the instructor has only ever said {', '.join(f'{value:g}' for value in values)}")
    if len(values) > MOST_CLASSES:
        direction: Array = Ridge().fit(standard, told).coef_
        return direction
    # hardly regularised: what the rule does not read shall not get a share of what it reads
    model = LogisticRegression(C=1_000, max_iter=1_000, random_state=seed)
    found, accuracy = _direction(model, standard, kinds, values)
    shares = np.abs(found) / (np.abs(found).max() or 1.0)
    for share in SPARSEST_FIRST:
        sparse, without = _direction(model, np.where(shares < share, 0, standard), kinds, values)
        if without >= accuracy - AS_ACCURATE and np.any(sparse[moving]):
            return sparse
    return found


def _direction(model: LogisticRegression, standard: Array, kinds: Array, values: Array) -> tuple[Array, float]:
    """Where the expected value rises ``(S,)``, and the share of what was said that the model gets right."""
    coefficients = model.fit(standard, kinds).coef_
    direction = (values[1] - values[0]) * coefficients[0] if len(values) == 2 else values @ coefficients
    return direction, float(model.score(standard, kinds))


def lasso_axes(delta: Array, instruction: Array, seed: int) -> Array:
    """Axes ``(S, d)`` from a sparse linear regression of the instruction ``(W, d)`` on the change ``(W, S)``.

    Raises:
        TooLittleDataError: with fewer windows than a regression needs.
    """
    _check_enough(delta)
    scale = StandardScaler().fit(delta).scale_
    axes = [LassoCV(cv=5, random_state=seed).fit(delta / scale, column).coef_ for column in instruction.T]
    return np.stack(axes, axis=1) / scale[:, None]


def information(delta: Array, instruction: Array, seed: int) -> Array:
    """Mutual information ``(S,)`` in nats of each dimension's change with the instruction, summed over its numbers."""
    each = [mutual_info_classif(delta, _classes(column), random_state=seed) for column in instruction.T]
    total: Array = np.sum(each, axis=0)
    return total


def _classes(told: Array) -> Array:
    """Values to the numbers of at most ``MOST_CLASSES`` classes."""
    values, kinds = np.unique(told, return_inverse=True)
    if len(values) <= MOST_CLASSES:
        return kinds
    inner = np.quantile(told, np.arange(1, MOST_CLASSES) / MOST_CLASSES)
    return np.searchsorted(inner, told)


def network(delta: Array, instruction: Array, kept: Array, hidden: Sequence[int], seed: int) -> Space:
    """A small network that regresses the instruction on the change (the authors' follow-up, ICONIP 2017).

    Args:
        delta: ``(W, S)``.
        instruction: ``(W, d)``.
        kept: ``(S,)`` bool, False for dimensions that it shall not see.
        hidden: widths of its layers.
        seed: of its first weights and of the windows held out.

    Raises:
        TooLittleDataError: with fewer windows than a regression needs.
    """
    _check_enough(delta)
    scaler = StandardScaler().fit(delta)
    told = instruction[:, 0] if instruction.shape[1] == 1 else instruction
    model = MLPRegressor(hidden_layer_sizes=tuple(hidden), early_stopping=True, max_iter=50, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # as many rounds as there is time for
        model.fit(scaler.transform(delta) * kept, told)
    first, *others = model.coefs_
    return Space(scaler.mean_, (first * (kept / scaler.scale_)[:, None], *others), tuple(model.intercepts_))


def _check_enough(delta: Array) -> None:
    if len(delta) < FEWEST_WINDOWS:
        raise TooLittleDataError(f"{len(delta)} windows are too few for a regression, which needs {FEWEST_WINDOWS}")
