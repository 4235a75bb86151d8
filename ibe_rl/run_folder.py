"""The folder of a run: its names, writing into it without losing anything, finding it again."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from ibe_rl.data import ConfigError

CONFIG = ".hydra/config.yaml"
OVERRIDES = ".hydra/overrides.yaml"
METRICS = "metrics.csv"
SUMMARY = "summary.json"
RECORDING = "recording.rrd"
CHECKPOINTS = "checkpoints"
TRAJECTORIES = "trajectories"
REFRESHES = "refreshes"
EVALUATION = "evaluation"
CALIBRATION = "calibration.json"
FIGURES = "figures"
LESSON = "lesson.jsonl"
NOT_IN_NAMES = ("run_dir", "viewer")
"""Settings that say nothing about a run when it is named after its settings."""


def write_atomically(path: Path, write: Callable[[BinaryIO], Any]) -> None:
    """Let ``write`` fill a file under another name, then put it in the place of ``path`` in one go."""
    temporary = path.with_name(path.name + ".partial")
    with temporary.open("wb") as stream:
        write(stream)
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(path)


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write ``values`` atomically, readable for people too."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    write_atomically(path, lambda stream: stream.write(text.encode()))


def create_run_folder(path: Path) -> Path:
    """Make the folder of a new run, with the folders in it.

    Raises:
        ConfigError: if it holds a run already, or cannot be written to.
    """
    try:
        if any((path / name).exists() for name in (METRICS, SUMMARY, RECORDING, CONFIG)):
            raise ConfigError(f"run_dir={path}: holds a run already; allowed is a new folder, nothing is overwritten")
        for name in (CHECKPOINTS, TRAJECTORIES, REFRESHES, ".hydra"):
            (path / name).mkdir(parents=True, exist_ok=True)
        write_atomically(path / CONFIG, lambda stream: stream.write(b""))
    except OSError as error:
        raise ConfigError(f"run_dir={path}: allowed is a folder that can be written to ({error.strerror})") from None
    return path


def is_run(path: Path) -> bool:
    """True for a folder with a run's config in it."""
    return (path / CONFIG).is_file()


def find_run(run: str | None, below: Path) -> Path:
    """Find the folder of a run.

    Args:
        run: its path; None takes the newest anywhere below ``below``.
        below: where runs are looked for.

    Raises:
        ConfigError: if ``run`` is not a run, or there is none.
    """
    if run is not None:
        if not is_run(Path(run)):
            raise ConfigError(f"run={run}: not a run folder (it has no {CONFIG}); allowed is one that train.py made")
        return Path(run)
    runs = [config.parent.parent for config in below.glob(f"**/{CONFIG}") if is_run(config.parent.parent)]
    if not runs:
        raise ConfigError(f"run=null: there is no run below {below}; train one, or name one with run=DIR")
    return max(runs, key=lambda path: (path / CONFIG).stat().st_mtime)


class MetricsTable:
    """``metrics.csv``: one row at a time, each on disk before the next; use as a context manager.

    Args:
        path: the file.
        later: columns that the first row may lack; the others are the first row's.
    """

    def __init__(self, path: Path, later: Iterable[str] = ()):
        self._stream = path.open("w", newline="")
        self._later = tuple(later)
        self._writer: csv.DictWriter[str] | None = None

    def __enter__(self) -> MetricsTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def write(self, row: Mapping[str, float]) -> None:
        """Append a row; columns that it lacks stay empty.

        Raises:
            ValueError: for a name that is no column.
        """
        if self._writer is None:
            columns = [*row, *(name for name in self._later if name not in row)]
            self._writer = csv.DictWriter(self._stream, columns, restval="")
            self._writer.writeheader()
        self._writer.writerow({name: _short(value) for name, value in row.items()})
        self._stream.flush()


def _short(value: float) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)
