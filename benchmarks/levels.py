"""Pure arithmetic of the figures: when a level was reached, and medians over runs that never did."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any


@dataclass(frozen=True)
class Point:
    """One evaluation: training frames and seconds until then, share of episodes that succeeded."""

    frames: int
    seconds: float
    success: float


@dataclass(frozen=True)
class Measured:
    """One single measurement; where ``reached`` is False the true value is at least ``value``."""

    value: float
    reached: bool = True


def reached(points: Sequence[Point], level: float) -> Point | None:
    """The second of the first two evaluations in a row with at least ``level``, or None."""
    for before, point in pairwise(points):
        if min(before.success, point.success) >= level:
            return point
    return None


def to_level(points: Sequence[Point], level: float, unit: str) -> Measured:
    """How much it took to a level; a run that never reached it counts up to its last evaluation.

    Args:
        points: the evaluations of a run.
        level: share of episodes that succeed.
        unit: "seconds" or "frames".
    """
    found = reached(points, level)
    return Measured(float(getattr(found or points[-1], unit)), found is not None)


def median(measured: Sequence[Measured]) -> Measured:
    """The median; ``reached`` is False if it would be higher with the runs that did not reach the level."""
    if not measured:
        return Measured(math.nan)
    value = statistics.median(single.value for single in measured)
    endless = statistics.median(single.value if single.reached else math.inf for single in measured)
    return Measured(value, endless == value)


def lowest(measured: Sequence[Measured]) -> Measured:
    """The lowest measurement."""
    return min(measured, key=lambda single: single.value)


def highest(measured: Sequence[Measured]) -> Measured:
    """The highest; ``reached`` is False if one that did not reach the level may be higher."""
    return Measured(max(single.value for single in measured), all(single.reached for single in measured))


def figure(
    name: str, unit: str, ours: Sequence[Measured] = (), other: Sequence[Measured] = (), what: str = "median"
) -> dict[str, Any]:
    """A record without its date: the figure and all single measurements.

    Args:
        name: of the figure.
        unit: of its values.
        ours: single measurements of ours.
        other: single measurements of what it is compared with; empty where nothing is.
        what: "median", "min" or "max" of the measurements.

    Returns:
        ``name``, ``unit``, ``ours``, ``other``, ``ratio`` (ours / other), ``at_least`` (those of ``ours`` and
        ``other`` that are lower bounds) and ``repeats``. What is not known is None.
    """
    one, two = (_summary(measured, what) for measured in (ours, other))
    comparable = one is not None and two is not None and two.value > 0
    sides = {"ours": one, "other": two}
    return {
        "name": name,
        "ours": one.value if one else None,
        "other": two.value if two else None,
        "unit": unit,
        "ratio": one.value / two.value if one and two and comparable else None,
        "at_least": [side for side, value in sides.items() if value and not value.reached],
        "repeats": {"ours": [asdict(single) for single in ours], "other": [asdict(single) for single in other]},
    }


def _summary(measured: Sequence[Measured], what: str) -> Measured | None:
    if not measured:
        return None
    return {"median": median, "min": lowest, "max": highest}[what](measured)


def plain(values: Sequence[float]) -> list[Measured]:
    """Measurements that are what they are."""
    return [Measured(float(value)) for value in values]
