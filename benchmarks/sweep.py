"""A sweep of two runs side by side, against the same two one after the other."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.child import run as run_command
from benchmarks.levels import figure, plain
from benchmarks.plan import Plan
from benchmarks.skill import Figures, Say
from ibe_rl.apps.sweep.jobs import read_summary

AS_MANY, ONE_PROCESS = "collect.envs_per_process=128", "collect.processes=1"
"""A run takes one core, with as many environments as by default."""


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Run both in turn, as often as asked; yields the figures so far after each round."""
    found: dict[int, list[float]] = {1: [], 2: []}
    for repeat in range(plan.repeats):
        say(f"sweep, round {repeat + 1} of {plan.repeats}")
        for at_once, rates in found.items():
            rates.append(frames_per_s(plan, at_once))
            say(f"  {at_once} at once: {rates[-1]:,.0f} frames a second")
        yield figures(found)


def figures(found: dict[int, list[float]]) -> Figures:
    """Two at once against one at a time."""
    return [figure("sweep_two_at_once", "frames/s", plain(found[2]), plain(found[1]))]


def frames_per_s(plan: Plan, at_once: int) -> float:
    """Frames a second of a whole sweep of two runs, starting and imports included."""
    sizes = plan.sizes
    asked = [AS_MANY, *sizes.overrides, ONE_PROCESS, "seed=0,1", f"total_frames={sizes.sweep_frames}"]
    with tempfile.TemporaryDirectory() as folder:
        sweep = Path(folder) / "sweep"
        start = time.perf_counter()
        run_command([sys.executable, "train.py", "-m", *asked, f"run_dir={sweep}", f"runs_at_once={at_once}"])
        seconds = time.perf_counter() - start
        summaries = [read_summary(run) for run in sweep.glob("*_seed=*")]
        return sum(summary["frames"] for summary in summaries if summary) / seconds
