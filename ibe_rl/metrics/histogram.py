"""The paper's histograms: how changes are distributed in several groups of episodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.types import Array

BINS = 41


def bin_edges(changes: Array, bins: int = BINS) -> Array:
    """Edges ``(bins + 1,)`` of bins of equal width about no change, with 99.5 % of changes ``(W,)`` inside."""
    limit = float(np.quantile(np.abs(changes), 0.995)) if len(changes) else 0.0
    return np.linspace(-1, 1, bins + 1) * (limit or 1.0)


def densities(groups: Sequence[Array], edges: Array) -> list[Array]:
    """For each group of changes ``(W,)`` its density ``(B,)`` over bins of equal width, 0 everywhere without data."""
    width = edges[1] - edges[0]
    return [np.histogram(values, edges)[0] / max(1, len(values)) / width for values in groups]
