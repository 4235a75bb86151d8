"""Trainings that are killed at moments drawn by chance, each taken up again to its end: make soak."""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, assert_whole, start
from view_data import eventually

from ibe_rl.storage.checkpoint import BETWEEN, EVALUATED, LATEST, policies
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import read_rows

pytestmark = pytest.mark.soak
KILLS = 20
RUN = [
    *SMALL,
    *("viewer=file", "total_frames=20000", "collect.steps_per_batch=32", "checkpoint_every_frames=1000"),
    *(
        "keep_policy_every_frames=1000",
        "eval_every_frames=5000",
        "agent.minibatch_size=64",
        "log.capacity_frames=16000",
    ),
]


def train(*arguments: str) -> None:
    process = start("train.py", *arguments)
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output


def kill(seconds: float, *arguments: str, folder: Path) -> bool:
    """Kill a training so many seconds after it can be resumed; False if it was at its end by then."""
    state = folder / "checkpoints" / LATEST
    before = state.stat().st_mtime_ns if state.exists() else None
    process = start("train.py", *arguments)
    assert eventually(lambda: (state.exists() and state.stat().st_mtime_ns != before) or process.poll() is not None)
    time.sleep(seconds)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate(timeout=240)
    assert process.returncode in (0, -signal.SIGKILL)
    return not (folder / "summary.json").exists()


def numbers(folder: Path) -> list[dict[str, str]]:
    with (folder / "metrics.csv").open(newline="") as stream:
        return [{k: v for k, v in row.items() if not k.startswith("time/")} for row in csv.DictReader(stream)]


def assert_equal(whole: Path, run: Path) -> None:
    """Rows, refreshes, episodes and policies are those of the uninterrupted run, and the recording is whole."""
    assert numbers(run) == numbers(whole)
    refreshes = [{path.name: path.read_text() for path in (one / "refreshes").glob("*.json")} for one in (whole, run)]
    assert refreshes[0] == refreshes[1]
    logs = [TrajectoryLog.open(one / "trajectories") for one in (whole, run)]
    assert np.array_equal(logs[0].index, logs[1].index)
    kept = [policies(one / "checkpoints", EVALUATED, BETWEEN).keys() for one in (whole, run)]
    assert kept[0] == kept[1]
    assert_whole(run / "recording.rrd")


def assert_nothing_lost(left: list[dict[str, str]], run: Path) -> None:
    """Every row that had been logged before the kill is in the run's table or was put aside."""
    aside = [row["frames"] for path in run.glob("replaced/*/metrics.csv") for row in read_rows(path)]
    kept = [row["frames"] for row in numbers(run)]
    assert {row["frames"] for row in left} <= {*kept, *aside}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "run"
    train(*RUN, f"run_dir={folder}")
    return folder


def loop_s(whole: Path) -> float:
    summary = json.loads((whole / "summary.json").read_text())
    return float(summary["wall_s"] - summary["time_s"]["setup"])


@pytest.mark.parametrize("number", range(KILLS))
def test_a_killed_run_is_resumed_to_the_same_end(number: int, whole: Path, tmp_path: Path) -> None:
    folder, draw = tmp_path / "run", random.Random(number)  # noqa: S311 - moments, not secrets
    while not kill(draw.uniform(0, loop_s(whole)), *RUN, f"run_dir={folder}", folder=folder):
        folder = folder.with_name(folder.name + "_again")  # it was faster than the one before
    left = numbers(folder) if (folder / "metrics.csv").exists() else []
    train(f"resume={folder}")
    assert_equal(whole, folder)
    assert_nothing_lost(left, folder)


def test_a_run_that_is_killed_again_and_again(whole: Path, tmp_path: Path) -> None:
    folder, draw = tmp_path / "run", random.Random(0)  # noqa: S311 - moments, not secrets
    killed, arguments = 0, [*RUN, f"run_dir={folder}"]
    while kill(draw.uniform(0, loop_s(whole) / 3), *arguments, folder=folder):
        killed, arguments = killed + 1, [f"resume={folder}"]
        assert killed < 50
    assert killed > 2
    assert_equal(whole, folder)
