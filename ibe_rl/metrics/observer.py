"""The paper's task for people, with a listener that is simulated and fixed beforehand.

The listener sees the beginning of an approach and predicts where it will end. Without an explanation it extrapolates
the present motion. It reads an expression as a movement on one scale: +1 is the typical movement to that side. The
scale is calibrated once, on true motion, and is the same for all explainers. A listener that could relearn a code would
make a wrong sign as good as a right one. Positions and movements are in the units of the explained state dimension.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ibe_rl.types import Array


@dataclass(frozen=True)
class Observer:
    """Who listens.

    Attributes:
        typical: the movement that an expression of 1 is read as; NaN if none was ever seen.
    """

    typical: float

    def reads(self, position: Array, expression: Array) -> Array:
        """From positions ``(N,)`` and what is said at them ``(N,)`` to the positions expected ``(N,)``."""
        return position + self.typical * expression


def calibrate_observer(change: Array, band: float) -> Observer:
    """Learn how far it typically goes, once it goes anywhere.

    Args:
        change: ``(N,)`` true changes of the explained dimension.
        band: up to which a change, either way, is none.

    Returns:
        The observer whose ``typical`` movement is the mean magnitude of the changes beyond the band.
    """
    moved = np.abs(change)[np.abs(change) > band]
    return Observer(float(np.mean(moved, dtype=float)) if len(moved) else math.nan)


def carries_on(position: Array, change_per_step: Array, steps: Array | int) -> Array:
    """What is expected without an explanation: the present motion goes on.

    Args:
        position: ``(N,)``.
        change_per_step: ``(N,)`` the present change of the position in one step.
        steps: until the end, ``(N,)`` or the same for all.

    Returns:
        ``(N,)`` the positions expected.
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
