"""Memory and disk stay bounded however long a training is; see ``long_run.py``, and docs/FAULTS.md for the figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from processes import ROOT, start

Report = dict[str, Any]
ALL_PARTS = ["collect.processes=1", "collect.envs_per_process=64", "collect.steps_per_batch=128", "eval_episodes=2"]
BYTES_A_FRAME = 62
"""Of the log: nine numbers of the state, the last one of an episode too, action, reward, instruction."""


def long_run(folder: Path, frames: int, report_every: int, *overrides: str) -> dict[int, Report]:
    """Reports by the number of that many frames, 1, 2 and so on; what has ended belongs to the last."""
    settings = [*ALL_PARTS, f"total_frames={frames}", f"run_dir={folder}", "viewer=file", *overrides]
    variables = {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    process = start("tests/long_run.py", str(report_every), *settings, **variables)
    output, _ = process.communicate()
    assert process.returncode == 0, output[-3000:]
    assert json.loads((folder / "summary.json").read_text())["frames"] >= frames
    reports = [json.loads(line[line.index("{") :]) for line in output.splitlines() if '"resident"' in line]
    return {report["frames"] // report_every: report for report in reports}


def assert_bounded(early: Report, late: Report, capacity_frames: int, max_recording_mb: int) -> None:
    """What has a bound keeps to it, and the memory does not grow any more."""
    assert late["resident"] < 1.1 * early["resident"]
    assert late["disk"]["trajectories"] < 1.05 * (capacity_frames * BYTES_A_FRAME + 100 * late["episodes"])
    assert late["disk"]["recording.rrd"] <= max_recording_mb * 1e6
    assert abs(late["episodes"] - early["episodes"]) < 0.05 * early["episodes"]
    assert late["disk"]["latest."] < 1.1 * early["disk"]["latest."]


def test_memory_and_disk_are_bounded(tmp_path: Path):
    """From 300,000 to 600,000 frames, each part of the bounded ones long full."""
    every = ["refresh_every_frames=50000", "eval_every_frames=300000", "checkpoint_every_frames=50000"]
    bounds = ["log.capacity_frames=20000", "viewer.max_recording_mb=1", "mapping.newest_frames=null"]
    small = ["mapping.horizon_steps=20", "mapping.spans_steps=[10]", "explain_every_steps=20"]
    reports = long_run(tmp_path / "run", 600_000, 100_000, *every, *bounds, *small)
    assert_bounded(reports[3], reports[6], capacity_frames=20_000, max_recording_mb=1)
    assert reports[6]["disk"]["recording.rrd"] > 0.4e6  # its bound is felt


@pytest.mark.soak
def test_twenty_million_frames(tmp_path: Path):
    every = ["refresh_every_frames=500000", "eval_every_frames=2000000", "checkpoint_every_frames=500000"]
    reports = long_run(tmp_path / "run", 20_000_000, 1_000_000, *every, "viewer.max_recording_mb=5")
    assert_bounded(reports[2], reports[20], capacity_frames=1_000_000, max_recording_mb=5)
    grown = {name: reports[20]["disk"][name] - reports[10]["disk"][name] for name in ("metrics.csv", "refreshes")}
    assert grown["metrics.csv"] < 10 * 50_000  # a row a batch
    assert grown["refreshes"] < 20 * 20_000  # one file each
    assert reports[20]["disk"]["between"] < 25e6
