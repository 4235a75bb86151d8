"""Seconds and memory of a refresh of the vocabulary, by the size of the log."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.child import measure
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say

COMPARED = {"10k": None, "100k": "10k", "1m": "10k", "3m_seen": "1m"}
"""Which log each one is compared with: how it grows, and that it does not once the log is full."""


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Fill all logs once, then learn from each of them in turn; yields the figures so far after each round."""
    with tempfile.TemporaryDirectory() as folder:
        for name, (frames, capacity) in plan.sizes.logs.items():
            path = str(Path(folder) / name)
            flown = plan.sizes.flown_frames
            seen = measure("refilling.fill", folder=path, frames=frames, capacity=capacity, flown_frames=flown)
            say(f"refresh: filled a log with {seen:,} frames")
        found: dict[str, list[dict[str, float]]] = {name: [] for name in plan.sizes.logs}
        for repeat in range(plan.repeats):
            say(f"refresh, round {repeat + 1} of {plan.repeats}")
            for name, measured in found.items():
                measured.append(measure("refilling.refresh", folder=str(Path(folder) / name)))
                say(f"  {name}: " + ", ".join(f"{key} {value:,.2f}" for key, value in measured[-1].items()))
            yield figures(found)


def figures(found: dict[str, list[dict[str, float]]]) -> Figures:
    """Seconds at each size against those at a smaller one, and the memory of the full log."""
    seconds = {name: plain([single["seconds"] for single in measured]) for name, measured in found.items()}
    grown = [
        figure(f"refresh_{name}_s", "s", seconds[name], seconds[smaller] if smaller else ())
        for name, smaller in COMPARED.items()
    ]
    return [*grown, figure("refresh_1m_mb", "MB", plain([single["mb"] for single in found["1m"]]))]
