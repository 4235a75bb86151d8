"""The paper's histograms: distributions of changes in groups of episodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.types import Array

BINS = 41


def bin_edges(changes: Array, bins: int = BINS) -> Array:
    """Edges ``(bins + 1,)`` of equal bins, symmetric about 0, that hold 99.5 % of changes ``(W,)``."""
    limit = float(np.quantile(np.abs(changes), 0.995)) if len(changes) else 0.0
    return np.linspace(-1, 1, bins + 1) * (limit or 1.0)


def densities(groups: Sequence[Array], edges: Array) -> list[Array]:
    """The density ``(B,)`` of each group of changes ``(W,)`` over equal bins, 0 for an empty group."""
    width = edges[1] - edges[0]
    return [np.histogram(values, edges)[0] / max(1, len(values)) / width for values in groups]
