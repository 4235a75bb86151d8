"""Spaces in which changes of the state are clustered: all dimensions, or axes learnt from the instructions."""

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

from ibe_rl.ibe.mistakes import best_fit
from ibe_rl.types import Array, read_only

MAX_CLASSES = 10
"""An instruction with more distinct values is regressed, one with fewer classified."""
SPARSITY_THRESHOLDS, MAX_ACCURACY_LOSS = (0.4, 0.2, 0.1), 0.025
"""Dimensions below such a share of the largest coefficient are dropped if the accuracy hardly falls.

Dropping a dimension that the rule does read cost .07 (docs/INSTRUCTION.md).
"""
MIN_REGRESSION_WINDOWS = 20
"""Some of them are held out for cross-validation or early stopping."""
MIN_UNIT = 0.5
"""The least that +1 counts as, as a share of the mean movement under an instruction, where little is followed."""


class TooLittleDataError(ValueError):
    """The windows are not enough for a vocabulary yet; the message says what is missing."""


@dataclass(frozen=True)
class Space:
    """Maps changes of the state ``(W, S)`` to places ``(W, P)``: shift, linear layers with ReLU, signed power.

    Attributes:
        mean: ``(S,)`` subtracted from a change, in observation units.
        weights: one matrix for each layer, ``(S, ...)`` to ``(..., P)``; a single one makes the space linear.
        biases: one vector for each layer.
        power: exponent of the magnitude of each coordinate; below 1 it spreads out small changes.
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
        """True if a place can be mapped back to a change."""
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
        """Undo the signed power only."""
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
        """The inverse of ``to_dict``; raises ValueError if a value is missing or a shape does not fit."""
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
    """Each dimension on its own: minus ``mean`` ``(S,)``, times ``weight`` ``(S,)``."""
    return Space(mean, (np.diag(weight),), (np.zeros(len(weight)),))


def along(axes: Array, power: float = 1.0) -> Space:
    """Projection onto the axes ``(S, d)``; no change is mapped to 0."""
    return Space(np.zeros(len(axes)), (axes,), (np.zeros(axes.shape[1]),), power)


def rule_axes(states: Array, instruction: Array, seed: int, moving: Array | None = None) -> Array:
    """Along which axes of the state the instruction changes: a sparse logistic regression of it on the state.

    The instruction is about movements along this axis, however the state is scaled or rotated. The regression does not
    tell their sign.

    Args:
        states: ``(N, S)`` states with an instruction, of good and bad episodes.
        instruction: ``(N, d)``, in each state.
        seed: of the solver.
        moving: ``(S,)`` bool, dimensions that change at all; an axis needs one of them. None: all.

    Returns:
        ``(S, d)``, in 1 / observation units.

    Raises:
        TooLittleDataError: if one of the numbers never changed.
    """
    scaler = StandardScaler().fit(states)
    standard = scaler.transform(states)
    can_move = np.ones(states.shape[1], bool) if moving is None else moving
    axes = [_gradient(standard, column, can_move, seed) for column in instruction.T]
    return np.stack(axes, axis=1) / scaler.scale_[:, None]


def consequences(axes: Array, delta: Array, instruction: Array) -> Array:
    """Set to 0 the dimensions of each axis ``(S, d)`` that move the same way under either sign of its instruction.

    They are conditions of the instruction, not consequences: how fast to sink depends on the height, which falls
    whatever is said. The axis of a single number stays as it is, so that it does not depend on the basis of the state.
    So does an axis of which no dimension moves both ways, or of which one sign never occurred. The windows are given by
    ``delta`` ``(W, S)`` and ``instruction`` ``(W, d)``.
    """
    kept = np.array(axes)
    if len(kept.T) == 1:
        return kept
    for axis, column in zip(kept.T, instruction.T, strict=True):
        if (column > 0).any() and (column < 0).any():
            both_ways = delta[column > 0].mean(axis=0) * delta[column < 0].mean(axis=0) < 0
            if np.any(axis * both_ways):
                axis[:] = np.where(both_ways | (np.ptp(delta, axis=0) == 0), axis, 0)
    return kept


def _gradient(standard: Array, instruction: Array, moving: Array, seed: int) -> Array:
    """The direction ``(S,)`` in which one number of the instruction rises, over as few dimensions as predict it."""
    values, kinds = np.unique(instruction, return_inverse=True)
    if len(values) < 2:
        raise TooLittleDataError(f"the instructor has only ever said {', '.join(f'{value:g}' for value in values)}")
    if len(values) > MAX_CLASSES:
        direction: Array = Ridge().fit(standard, instruction).coef_
        return direction
    fit, model = best_fit(standard, kinds, seed)
    found, accuracy = _direction(model, standard, kinds, values)
    shares = np.abs(found) / (np.abs(found).max() or 1.0)
    for share in SPARSITY_THRESHOLDS:
        kept = np.where(shares < share, 0, standard)
        sparse, without = _direction(fit(kept, kinds, seed), kept, kinds, values)
        if without >= accuracy - MAX_ACCURACY_LOSS and np.any(sparse[moving]):
            return sparse
    return found


def _direction(model: LogisticRegression, standard: Array, kinds: Array, values: Array) -> tuple[Array, float]:
    """The direction ``(S,)`` in which the expected instruction rises, and the accuracy of the model."""
    direction = (values[1] - values[0]) * model.coef_[0] if len(values) == 2 else values @ model.coef_
    return direction, float(model.score(standard, kinds))


def lasso_axes(delta: Array, instruction: Array, seed: int) -> Array:
    """Axes ``(S, d)`` by the lasso regression of the instruction ``(W, d)`` on the change ``(W, S)``.

    Raises:
        TooLittleDataError: with fewer than ``MIN_REGRESSION_WINDOWS``.
    """
    _check_enough(delta)
    scale = StandardScaler().fit(delta).scale_
    axes = [LassoCV(cv=5, random_state=seed).fit(delta / scale, column).coef_ for column in instruction.T]
    return np.stack(axes, axis=1) / scale[:, None]


def information(delta: Array, instruction: Array, seed: int) -> Array:
    """Mutual information ``(S,)`` of each dimension's change with the instruction, in nats, summed over its numbers."""
    each = [mutual_info_classif(delta, _classes(column), random_state=seed) for column in instruction.T]
    total: Array = np.sum(each, axis=0)
    return total


def _classes(instruction: Array) -> Array:
    """Class labels, at most ``MAX_CLASSES``: the values themselves, or quantile bins."""
    values, kinds = np.unique(instruction, return_inverse=True)
    if len(values) <= MAX_CLASSES:
        return kinds
    inner = np.quantile(instruction, np.arange(1, MAX_CLASSES) / MAX_CLASSES)
    return np.searchsorted(inner, instruction)


def network(delta: Array, instruction: Array, kept: Array, hidden: Sequence[int], seed: int) -> Space:
    """A small network that regresses the instruction on the change (the authors' follow-up, ICONIP 2017).

    ``kept`` ``(S,)`` bool masks dimensions, ``hidden`` are the widths of the hidden layers; raises as ``lasso_axes``.
    """
    _check_enough(delta)
    scaler = StandardScaler().fit(delta)
    target = instruction[:, 0] if instruction.shape[1] == 1 else instruction
    model = MLPRegressor(hidden_layer_sizes=tuple(hidden), early_stopping=True, max_iter=50, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # max_iter bounds the time
        model.fit(scaler.transform(delta) * kept, target)
    first, *others = model.coefs_
    return Space(scaler.mean_, (first * (kept / scaler.scale_)[:, None], *others), tuple(model.intercepts_))


def _check_enough(delta: Array) -> None:
    if len(delta) < MIN_REGRESSION_WINDOWS:
        raise TooLittleDataError(
            f"{len(delta)} windows are too few for a regression, which needs {MIN_REGRESSION_WINDOWS}"
        )


def movement_of_one(places: Array, instruction: Array, weight: Array, known: Array) -> Array:
    """The unit of movement ``(d,)``: how far the instruction 1 moved along each axis, by least squares without bias.

    Windows have places and instructions ``(W, d)`` and weights ``(W,)``. Where the sign is known (``(d,)`` bool) the
    axis points the way that +1 asks for. There the unit is positive, and at least ``MIN_UNIT`` of the mean movement.

    Raises:
        TooLittleDataError: if no instruction but 0 was given along an axis, or nothing moved under it.
    """
    squares = weight @ instruction**2
    moved = np.divide(weight @ (places * instruction), squares, out=np.zeros_like(squares), where=squares > 0)
    if not np.all(np.abs(moved) > 0):
        raise TooLittleDataError("nothing has moved under an instruction other than 0 in the best episodes")
    share = weight[:, None] * (instruction != 0)
    least = MIN_UNIT * (share * np.abs(places)).sum(axis=0) / share.sum(axis=0)
    return np.where(known, np.maximum(moved, least), moved)
