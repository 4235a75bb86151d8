"""The folder of a run: file names, atomic writing, and finding it again."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import stat
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any, BinaryIO

import yaml

from ibe_rl.types import ConfigError

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
POLICY_SUMMARY = "summary"
LESSON = "lesson.jsonl"
WORD_LIST = "words.json"
REPLACED = "replaced"
PARTIAL = ".partial"
"""Ends the name of a folder that takes its own name once it is complete."""
LONGEST_YAML, DEEPEST_YAML = 100_000, 500
NOT_IN_NAMES = ("run_dir", "viewer", "logger", "runs_at_once", "runs_on")
"""Settings left out of a run's name."""


def write_atomically(path: Path, write: Callable[[BinaryIO], Any]) -> None:
    """Let ``write`` fill a temporary file, then rename it to ``path``.

    Raises:
        OSError: naming ``path``, which is unchanged.
    """
    temporary = path.with_name(path.name + PARTIAL)
    try:
        with temporary.open("wb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except Exception as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        failed = error if isinstance(error, OSError) else error.__context__  # torch raises another error on top
        if isinstance(failed, OSError) and failed.errno:
            raise OSError(failed.errno, failed.strerror, str(path)) from None
        raise


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write ``values`` atomically as indented JSON."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    write_atomically(path, lambda stream: stream.write(text.encode()))


def read_json(path: Path) -> Any:
    """Read JSON.

    Raises:
        ValueError: if it is not JSON.
        OSError: if it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("nested too deeply") from None


def read_yaml(path: Path) -> Any:
    """Read YAML of plain values, without type tags or aliases.

    Raises:
        ValueError: if it is not such YAML.
        OSError: if it cannot be read.
    """
    try:
        text = path.read_text()
        if len(text) > LONGEST_YAML or text.count("[") + text.count("{") > DEEPEST_YAML:
            raise ValueError("longer, or nested more deeply, than settings are")  # the parser would take minutes
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, yaml.SafeLoader)):
            raise ValueError("an alias (*) in it; allowed are plain values")
        return yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"no plain YAML: {' '.join(str(error).split())[:200]}") from None


def read_overrides(path: Path) -> list[str]:
    """The overrides that a run was started with; empty if unknown."""
    try:
        given = read_yaml(path)
    except (OSError, ValueError):
        return []
    return [one for one in given if isinstance(one, str)] if isinstance(given, list) else []


def refuse_special_files(path: Path) -> None:
    """Refuse a run folder with links, which could write elsewhere, or pipes, which hang.

    Raises:
        ConfigError: naming it.
    """
    for found in path.rglob("*"):
        with suppress(FileNotFoundError):  # a run in training replaces files
            mode = found.lstat().st_mode
            if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
                kind = "a link to another place" if stat.S_ISLNK(mode) else "neither a file nor a folder"
                raise ConfigError(f"{found}: {kind}; allowed is a run folder of plain files")


class TakenFolderError(ConfigError):
    """A folder for a new run already holds one."""


def create_run_folder(path: Path, named: Path | None = None) -> Path:
    """Make the folder of a new run and its subfolders.

    Args:
        path: of the folder.
        named: what errors call it; None: its path.

    Raises:
        TakenFolderError: if it already holds a run, also one that another process has just begun.
        ConfigError: if it cannot be written to.
    """
    refuse_used(path)
    try:
        for name in (CHECKPOINTS, TRAJECTORIES, REFRESHES, ".hydra"):
            (path / name).mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path / CONFIG, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        os.close(descriptor)
    except OSError as error:
        if (path / CONFIG).is_file():
            raise TakenFolderError(_taken(named or path)) from None
        allowed = f"allowed is a folder that can be written to ({error.strerror})"
        raise ConfigError(f"run_dir={named or path}: {allowed}") from None
    return path


def refuse_used(path: Path) -> None:
    """Refuse a folder that already holds a run, or cannot be looked into.

    Raises:
        TakenFolderError: if it holds a run.
        ConfigError: if it cannot be looked into.
    """
    try:
        used = any((path / name).exists() for name in (METRICS, SUMMARY, RECORDING, CONFIG))
    except OSError as error:
        raise ConfigError(f"run_dir={path}: allowed is a folder that can be written to ({error.strerror})") from None
    if used:
        raise TakenFolderError(_taken(path))


def _taken(path: Path) -> str:
    return f"run_dir={path}: holds a run already; allowed is a new folder, nothing is overwritten"


def is_run(path: Path) -> bool:
    """True for a folder with a run's config."""
    return (path / CONFIG).is_file()


def find_run(run: str | None, below: Path, fits: Callable[[Path], bool] = lambda _: True) -> Path:
    """Find the folder of a run.

    Args:
        run: its path; None takes the newest below ``below``.
        below: where to search.
        fits: of several, whether one is what is asked for; those that do not come last.

    Raises:
        ConfigError: if ``run`` is not a run, or none is found.
    """
    if run is not None:
        if not is_run(Path(run)):
            raise ConfigError(f"run={run}: not a run folder (it has no {CONFIG}); allowed is one that train.py made")
        return Path(run)
    runs = [config.parent.parent for config in below.glob(f"**/{CONFIG}") if is_run(config.parent.parent)]
    runs = [found for found in runs if not any(part.endswith(PARTIAL) for part in found.parts)]
    runs = [*filter(fits, runs)] or runs
    if not runs:
        raise ConfigError(f"run=null: there is no run below {below}; train one, or name one with run=DIR")
    return max(runs, key=lambda path: (path / CONFIG).stat().st_mtime)


class MetricsTable:
    """``metrics.csv``, written row by row; use as a context manager.

    Args:
        path: the file.
        later: columns that the first row may lack.
        until_frames: keep the file's rows up to there and drop the others; None starts a new file.
    """

    def __init__(self, path: Path, later: Iterable[str] = (), until_frames: int | None = None):
        self._path, self._later = path, tuple(later)
        self._rows = [] if until_frames is None else read_rows(path, until_frames=until_frames)
        self._columns: list[str] = []
        self._stream: FileIO | None = None

    def __enter__(self) -> MetricsTable:
        return self

    def __exit__(self, *_: object) -> None:
        if self._stream is not None:
            self._stream.close()

    def write(self, row: Mapping[str, float]) -> None:
        """Append a row; missing columns stay empty.

        Raises:
            ValueError: for an unknown column.
            OSError: if it cannot be written; the file ends with the previous row.
        """
        if self._stream is None:
            self._stream = self._begin(row)
        line = _table([{name: _short(value) for name, value in row.items()}], self._columns)
        append(self._stream, line, self._path)

    def _begin(self, row: Mapping[str, float]) -> FileIO:
        """Atomically write the header and the kept rows, with all columns."""
        self._columns = list(dict.fromkeys([*row, *self._later, *(self._rows[0] if self._rows else ())]))
        write_rows(self._path, self._rows, self._columns)
        self._rows = []
        return self._path.open("ab", buffering=0)


def append(stream: FileIO, data: bytes, path: Path) -> None:
    """Append all of ``data`` to a file, or nothing.

    Raises:
        OSError: naming ``path``.
    """
    before, left = os.fstat(stream.fileno()).st_size, memoryview(data)
    try:
        while left:
            left = left[stream.write(left) :]
    except OSError as error:
        with suppress(OSError):
            stream.truncate(before)
        raise OSError(error.errno, error.strerror, str(path)) from None


def read_rows(path: Path, above_frames: float = -1, until_frames: float = math.inf) -> list[dict[str, str]]:
    """Rows of a ``metrics.csv`` after one frame and up to another, without an incomplete last row.

    Raises:
        ConfigError: if it cannot be read.
    """
    try:
        whole, _, _ = path.read_bytes().decode().rpartition("\n")
        rows = csv.DictReader(io.StringIO(whole, newline=""))
        return [row for row in rows if above_frames < int(row["frames"]) <= until_frames]
    except (OSError, KeyError, TypeError, ValueError, csv.Error) as error:
        raise ConfigError(f"{path}: not the readable table of a run ({error!r:.200})") from None


def write_rows(path: Path, rows: Sequence[Mapping[str, str]], columns: Iterable[str] = ()) -> None:
    """Write a table atomically, by default with the columns of its first row."""
    names = list(columns) or list(rows[0])
    table = _table([dict(zip(names, names, strict=True)), *rows], names)
    write_atomically(path, lambda stream: stream.write(table))


def _table(rows: Iterable[Mapping[str, str]], columns: Sequence[str]) -> bytes:
    text = io.StringIO(newline="")
    csv.DictWriter(text, columns, restval="").writerows(rows)
    return text.getvalue().encode()


def _short(value: float) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)
