"""The paper's prediction task for people, with a simulated observer that is fixed beforehand.

The observer sees part of an episode and predicts its final position. Without an explanation it extrapolates the
current motion. It reads an expression as a movement on one scale: +1 is the typical positive movement. The scale
is calibrated once, on true motion, for all explainers. An observer that learnt each code would accept a wrong
sign as well as a right one. Positions and movements are in the units of the explained state dimension.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ibe_rl.types import Array


@dataclass(frozen=True)
class Observer:
    """The simulated observer.

    Attributes:
        typical: the movement that an expression of 1 stands for; NaN without data.
    """

    typical: float

    def reads(self, position: Array, expression: Array) -> Array:
        """Positions ``(N,)`` and expressions ``(N,)`` to predicted positions ``(N,)``."""
        return position + self.typical * expression


def calibrate_observer(change: Array, band: float) -> Observer:
    """Learn the typical movement.

    Args:
        change: ``(N,)`` true changes of the explained dimension.
        band: changes of at most this magnitude count as none.

    Returns:
        The observer whose ``typical`` movement is the mean magnitude of the changes beyond the band.
    """
    moved = np.abs(change)[np.abs(change) > band]
    return Observer(float(np.mean(moved, dtype=float)) if len(moved) else math.nan)


def carries_on(position: Array, change_per_step: Array, steps: Array | int) -> Array:
    """The prediction without an explanation: the current motion continues.

    Args:
        position: ``(N,)``.
        change_per_step: ``(N,)`` the current change of the position in one step.
        steps: until the end, ``(N,)`` or the same for all.

    Returns:
        ``(N,)`` the predicted positions.
    """
    return position + change_per_step * steps


def observer_errors(predicted: Array, actual: Array, width: float) -> Array:
    """Distances ``(N,)`` of predicted from actual positions ``(N,)``, in % of the width.

    Raises:
        ValueError: if the width is not above 0.
    """
    if not width > 0:
        raise ValueError(f"width={width}: allowed is above 0")
    return 100 * np.abs(predicted - actual) / width
