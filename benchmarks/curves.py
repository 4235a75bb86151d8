"""The learning curves of all runs to skill: kept in a file after each seed, and taken up again from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.levels import Point
from benchmarks.records import Record, load


@dataclass(frozen=True)
class Curve:
    """A run to skill.

    Attributes:
        points: its evaluations.
        wall_s: seconds of all of it, evaluations included; None where nobody asks.
        fresh_success: of its end, on episodes that the training has not seen; None where nobody asks.
    """

    points: list[Point]
    wall_s: float | None = None
    fresh_success: float | None = None


Sides = dict[str, Curve]
"""The runs of one seed: "ours", "rewarded" if there is one, and Stable-Baselines3's by its environment's step."""


def to_records(part: str, names: Mapping[str, str], seeds: Mapping[int, Sides], about: Record) -> list[Record]:
    """All runs of a part as records, side by side.

    Args:
        part: of the benchmarks.
        names: how each side is called in the file and the picture.
        seeds: the runs of each seed.
        about: how and where they were run.
    """
    return [
        {"part": part, "side": name, "seed": seed, **columns(sides[side]), "about": about}
        for side, name in names.items()
        for seed, sides in seeds.items()
    ]


def load_seeds(path: Path, part: str, names: Mapping[str, str], about: Record) -> dict[int, Sides]:
    """The seeds of which all sides are in the file, run in the same way and on the same machine."""
    side_of = {name: side for side, name in names.items()}
    found: dict[int, Sides] = {}
    for record in load(path):
        if record["part"] == part and record["side"] in side_of and record.get("about") == about:
            found.setdefault(record["seed"], {})[side_of[record["side"]]] = curve(record)
    return {seed: sides for seed, sides in sorted(found.items()) if sides.keys() == names.keys()}


def columns(run: Curve) -> dict[str, Any]:
    """A curve as lists, its seconds to the millisecond."""
    return {
        "frames": [point.frames for point in run.points],
        "seconds": [round(point.seconds, 3) for point in run.points],
        "success": [round(point.success, 3) for point in run.points],
        "wall_s": None if run.wall_s is None else round(run.wall_s, 3),
        "fresh_success": run.fresh_success,
    }


def curve(record: Record) -> Curve:
    """The inverse of ``columns``."""
    rows = zip(record["frames"], record["seconds"], record["success"], strict=True)
    return Curve([Point(*row) for row in rows], record["wall_s"], record["fresh_success"])
