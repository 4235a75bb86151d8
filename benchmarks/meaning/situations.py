"""All situations."""

from __future__ import annotations

from benchmarks.meaning import game_situations, point_mass_situations
from benchmarks.meaning.situation import Situation


def situations() -> dict[str, Situation]:
    """All of them by their names."""
    return {one.name: one for one in (*game_situations.SITUATIONS, *point_mass_situations.SITUATIONS)}
