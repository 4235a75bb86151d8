"""Set-up of the default run: seconds from the start of the process to its first batch."""

from __future__ import annotations

import csv
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.child import run as run_command
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say
from ibe_rl.storage.run_folder import METRICS

ONE_BATCH = ("stop_after_frames=1", "eval_episodes=1")
PARTS_S = ("imports", "making", "batch")


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Start the default run as often as asked; yields the figures so far after each start."""
    found: list[dict[str, float]] = []
    for repeat in range(plan.repeats):
        say(f"setup, round {repeat + 1} of {plan.repeats}")
        found.append(start_once(*plan.sizes.overrides))
        say(f"  {', '.join(f'{name} {seconds:.1f} s' for name, seconds in found[-1].items())}")
        yield figures(found)


def figures(found: list[dict[str, float]]) -> Figures:
    """All of it, and its parts."""
    whole = figure("setup_s", "s", plain([sum(parts.values()) for parts in found]))
    return [whole, *(figure(f"setup_{name}_s", "s", plain([parts[name] for parts in found])) for name in PARTS_S)]


def start_once(*overrides: str) -> dict[str, float]:
    """Seconds of each part of ``PARTS_S`` in one run of train.py that ends after its first batch."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        start = time.time()
        run_command([sys.executable, "train.py", "viewer=file", *overrides, *ONE_BATCH, f"run_dir={path}"])
        written = (path / METRICS).stat().st_mtime
        with (path / METRICS).open() as stream:
            [row] = csv.DictReader(stream)
    return parts_of(written - start, row)


def parts_of(seconds: float, row: dict[str, str]) -> dict[str, float]:
    """Divide the time until a row of metrics.csv was written by what the row says of it.

    Args:
        seconds: from the start of the process until the first row was written.
        row: the first row.
    """
    told = {name: float(text) for name, text in row.items() if name.startswith("time/")}
    return {
        "imports": seconds - sum(told.values()),
        "making": told["time/setup"],
        "batch": told["time/collect"],
    }
