"""Balance of a vocabulary: cluster sizes, and expressions on both sides of 0."""

from __future__ import annotations

import numpy as np

from ibe_rl.metrics.bootstrap import ratio
from ibe_rl.types import Array


def size_cv(sizes: Array) -> float:
    """Coefficient of variation of the cluster sizes ``(k,)``: population standard deviation over mean.

    0 if they are equal, sqrt(k - 1) if one cluster holds everything, NaN if all are empty.
    """
    return float(ratio(np.std(sizes), np.mean(sizes)))


def size_max(sizes: Array) -> float:
    """Largest share of the cluster sizes ``(k,)``: from 1 / k to 1, NaN if all are empty."""
    return float(ratio(np.max(sizes), np.sum(sizes)))


def left_right(expressions: Array) -> tuple[int, int]:
    """Number of distinct expressions ``(k,)`` below and above 0, equal within 1e-9."""
    distinct = np.unique(np.round(expressions, 9))
    return int(np.sum(distinct < 0)), int(np.sum(distinct > 0))
