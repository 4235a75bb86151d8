"""All situations."""

from __future__ import annotations

from benchmarks.meaning import games, masses
from benchmarks.meaning.situation import Situation


def situations() -> dict[str, Situation]:
    """All of them by their names."""
    return {one.name: one for one in (*games.SITUATIONS, *masses.SITUATIONS)}
