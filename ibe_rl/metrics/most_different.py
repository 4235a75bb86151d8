"""Which few stand for all? The most typical one first, then whichever differs most from those already chosen."""

from __future__ import annotations

import numpy as np

from ibe_rl.types import Array


def most_different(profiles: Array, count: int) -> list[int]:
    """Choose rows by farthest-point traversal.

    Args:
        profiles: ``(E, F)``, columns on one scale.
        count: how many at most.

    Returns:
        Rows: the nearest to the mean, then each time the farthest from all that are chosen, the first of equals. Fewer
        than ``count`` if all others are like a chosen one.
    """
    away = np.linalg.norm(profiles - profiles.mean(axis=0), axis=1)
    chosen = [int(np.argmin(away.round(9)))]
    while len(chosen) < count:
        nearest = np.linalg.norm(profiles[:, None] - profiles[chosen], axis=2).min(axis=1).round(9)
        if not nearest.max() > 0:
            break
        chosen.append(int(np.argmax(nearest)))
    return chosen
