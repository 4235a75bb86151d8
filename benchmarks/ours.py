"""Our side: train.py as a user starts it, read back from the folder that it leaves behind."""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.child import measure, run
from benchmarks.levels import Point
from ibe_rl.storage.run_folder import METRICS, SUMMARY


@dataclass(frozen=True)
class TrainingRun:
    """What a run of train.py took.

    Attributes:
        summary: its summary.json.
        points: its evaluations.
        fresh_success: of its end, on episodes that the training has not seen; None if nobody asked.
    """

    summary: dict[str, Any]
    points: list[Point]
    fresh_success: float | None = None

    def share(self, *names: str) -> float:
        """The share of the wall time that these parts of ``time_s`` took together."""
        return float(sum(self.summary["time_s"][name] for name in names) / self.summary["wall_s"])

    def frames_per_s(self) -> float:
        """Frames a second of the whole pipeline, without set-up and evaluation."""
        times = self.summary["time_s"]
        return float(self.summary["frames"] / (self.summary["wall_s"] - times["setup"] - times["eval"]))


def train(*overrides: str, fresh_episodes: int = 0) -> TrainingRun:
    """Run train.py with everything on, recording to a file, in a folder that goes away again.

    Args:
        *overrides: of the run.
        fresh_episodes: on which its end is judged as well.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        run([sys.executable, "train.py", "viewer=file", *overrides, f"run_dir={path}"])
        with (path / METRICS).open() as stream:
            points = read_points(list(csv.DictReader(stream)))
        fresh = measure("fresh.success", folder=str(path), episodes=fresh_episodes) if fresh_episodes else None
        return TrainingRun(json.loads((path / SUMMARY).read_text()), points, fresh)


def read_points(rows: list[dict[str, str]]) -> list[Point]:
    """The evaluations among the rows of metrics.csv; their seconds count everything but evaluations."""
    evaluated = [row for row in rows if row["eval/success_rate"]]
    return [Point(int(row["frames"]), seconds(row), float(row["eval/success_rate"])) for row in evaluated]


def seconds(row: dict[str, str]) -> float:
    """Seconds until this row of metrics.csv, without evaluations."""
    return sum(float(text) for name, text in row.items() if name.startswith("time/") and name != "time/eval")
