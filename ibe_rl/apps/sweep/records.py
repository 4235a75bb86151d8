"""The results of the runs of a sweep: curves, final values and condition."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ibe_rl.apps.sweep.jobs import OUTPUT, last_line, read_summary
from ibe_rl.storage.run_folder import EVALUATION, METRICS, NOT_IN_NAMES, is_run, read_rows
from ibe_rl.types import Array, ConfigError
from ibe_rl.view.viewer import overrides_of, run_names

SEED = "seed"
ALL = "all runs"
"""The condition if only the seed differs."""
NO_RESULTS = ("frames", "time/", "ibe/skipped")
LEARNING = {
    "train/return_mean": "return of the newest 100 episodes",
    "train/success_rate": "success of the newest 100 episodes",
    "eval/return_mean": "return, greedy, unseen episodes",
    "eval/success_rate": "success, greedy, unseen episodes",
}
TRUTH = {
    "ibe/motion_auc": "direction of motion from the words (AUC)",
    "ibe/motion_auc_disobeyed": "the same where it did not follow the instruction (AUC)",
    "ibe/instruction_f1": "instruction from the words (F1)",
    "ibe/came_true": "share of explanations that went as predicted",
    "ibe/unknown": "share of “I do not know”",
    "ibe/vocabulary_drift": "drift of the vocabulary at a refresh",
}
JUDGED = {
    "quality/motion_auc": "judged: motion AUC",
    "quality/motion_auc_disobeyed": "judged: the same where it did not follow the instruction",
    "quality/vocabulary_loss": "judged: lost by the vocabulary (AUC)",
    "quality/came_true": "judged: share that went as predicted",
    "quality/observer_error": "judged: error of an observer (% of the width)",
}
COLUMN_LABELS = LEARNING | TRUTH | JUDGED
"""Labels of the columns of metrics.csv and the metrics of quality.json."""
RunCurve = tuple[Array, Array]
"""Frames and values ``(rows,)`` of the rows with a value."""


@dataclass(frozen=True)
class SweepRun:
    """A run of a sweep.

    Attributes:
        name: the settings in which it differs from the others.
        condition: the same without the seed.
        seed: its seed.
        folder: its folder.
        missing: why it is left out, empty if it counts.
        curves: columns of metrics.csv.
        ends: their final values, and the metrics of quality.json.
    """

    name: str
    condition: str
    seed: str
    folder: Path
    missing: str
    curves: dict[str, RunCurve]
    ends: dict[str, float]


def read_sweep(sweep: Path) -> list[SweepRun]:
    """Read the runs of a sweep, ordered by number.

    Raises:
        ConfigError: if there are none, or a file of one is damaged.
    """
    if is_run(sweep):
        raise ConfigError(f"sweep={sweep}: it is one run; allowed is run={sweep}, or the folder of a sweep")
    runs = [path for path in sweep.glob("*") if is_run(path) or (path / OUTPUT).is_file()]
    if not runs:
        raise ConfigError(f"sweep={sweep}: there is no run in it; allowed is a folder that train.py -m made")
    runs.sort(key=lambda path: (int("0" + re.sub(r"\D.*", "", path.name)), path.name))
    every = zip(runs, run_names(runs), conditions(runs), strict=True)
    return [_read(run, name, condition) for run, name, condition in every]


def conditions(runs: Sequence[Path]) -> list[str]:
    """The condition of each run: the settings in which the runs differ, without the seed."""
    given = [overrides_of(run) for run in runs]
    known = [overrides for overrides in given if overrides]
    keys = dict.fromkeys(key for overrides in known for key in overrides if key not in (*NOT_IN_NAMES, SEED))
    differ = [key for key in keys if len({overrides.get(key) for overrides in known}) > 1]
    names = [", ".join(f"{key}={one.get(key, 'default')}" for key in differ) for one in given]
    return [name or ALL for name in names]


def _read(run: Path, name: str, condition: str) -> SweepRun:
    rows = read_rows(run / METRICS) if (run / METRICS).is_file() else []
    columns = [column for column in (rows[0] if rows else ()) if not column.startswith(NO_RESULTS)]
    curves = {column: curve(run / METRICS, rows, column) for column in columns}
    curves = {column: found for column, found in curves.items() if len(found[0])}
    ends = {column: float(values[-1]) for column, (_, values) in curves.items()} | quality_scores(run)
    seed = overrides_of(run).get(SEED, "0")
    return SweepRun(name, condition, seed, run, missing(run, rows), curves, ends)


def curve(path: Path, rows: Sequence[dict[str, str]], column: str) -> RunCurve:
    """Frames and values of a column, from the rows in which it is filled.

    Raises:
        ConfigError: if a cell is not a number.
    """
    filled = [row for row in rows if row[column]]
    try:
        return np.array([int(row["frames"]) for row in filled]), np.array([float(row[column]) for row in filled])
    except ValueError as error:
        raise ConfigError(f"{path}: column {column} has a value that is not a number ({error})") from None


def missing(run: Path, rows: Sequence[dict[str, str]]) -> str:
    """Why a run is left out; empty if it is finished."""
    summary, frames = read_summary(run), int(rows[-1]["frames"]) if rows else 0
    if summary is not None:
        return f"stopped early, at {frames:,} frames" if summary.get("stopped_early") else ""
    last = last_line(run / OUTPUT) if (run / OUTPUT).is_file() else ""
    said = f"; its last output: {last}" if "error" in last.lower() else ""
    return (f"not finished, at {frames:,} frames" if frames else "not started") + said


def quality_scores(run: Path) -> dict[str, float]:
    """The metrics of a run's evaluation; empty without one.

    Raises:
        ConfigError: if the file is damaged.
    """
    path = run / EVALUATION / "quality.json"
    if not path.is_file():
        return {}
    try:
        quality = json.loads(path.read_text())
        about = quality["protocol"]
        mine = {"explainer": f"ibe:{about['mapping']}", "horizon_steps": about["horizon_steps"]}
        row = next(row for row in quality["rows"] if {key: row[key] for key in mine} == mine)
        values = {column: row.get(column.removeprefix("quality/"), {}).get("value") for column in JUDGED}
        return {column: float(value) for column, value in values.items() if value is not None}
    except (OSError, ValueError, KeyError, TypeError, StopIteration) as error:
        raise ConfigError(f"{path}: not a readable judgement ({error!r})") from None
