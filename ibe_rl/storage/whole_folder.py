"""A run folder, or a file, that is there as a whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path

from ibe_rl.storage.folder_lock import LOCK, hold_folder
from ibe_rl.storage.log_columns import ABOUT_LOG, COLUMNS
from ibe_rl.storage.run_folder import (
    CONFIG,
    METRICS,
    PARTIAL,
    TRAJECTORIES,
    TakenFolderError,
    create_run_folder,
    read_json,
    refuse_used,
)
from ibe_rl.types import ConfigError


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Fill a new run folder under another name; rename it in the end, or remove it if the body fails.

    Args:
        path: of the new folder; what it already holds stays.

    Raises:
        ConfigError: if it already holds a run or cannot be written to.
    """
    refuse_used(path)
    partial = _partial(path)
    held = f"run_dir={path}: another program is making it; allowed is a new folder"
    if (partial / CONFIG).parent.is_dir():
        with hold_folder(partial, held):
            shutil.rmtree(partial)  # of a program that was killed
    create_run_folder(partial, named=path)
    with hold_folder(partial, held):
        try:
            yield partial
            (partial / LOCK).unlink()
            _move(partial, path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def _move(partial: Path, path: Path) -> None:
    try:
        if not path.exists():
            partial.rename(path)
            return
        for part in sorted(partial.iterdir(), reverse=True):  # .hydra comes last: it makes a folder a run
            part.rename(path / part.name)
    except OSError as error:
        raise ConfigError(f"run_dir={path}: allowed is a new folder ({error.strerror})") from None


@contextmanager
def whole_file(path: Path, key: str) -> Iterator[Path]:
    """Write a file under another name; rename it in the end, or remove it if the body fails.

    Args:
        path: of the file; one that is there is replaced.
        key: the setting that named it.

    Raises:
        ConfigError: if it cannot be written.
    """
    partial = _partial(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        partial.replace(path)
    except OSError as error:
        raise ConfigError(f"{key}={path}: allowed is a file that can be written ({error.strerror})") from None
    finally:
        if partial.parent.is_dir():
            partial.unlink(missing_ok=True)


def unused(path: Path) -> Path:
    """``path``, or the first of ``path_2``, ``path_3`` … that holds no run and that no other program is making.

    Raises:
        ConfigError: if one of them cannot be looked into.
    """
    return next(one for one in _numbered(path) if _is_unused(one))


def _is_unused(path: Path) -> bool:
    try:
        refuse_used(path)
    except TakenFolderError:
        return False
    return not _partial(path).exists()


def _numbered(path: Path) -> Iterator[Path]:
    return chain([path], (path.with_name(f"{path.name}_{number}") for number in count(2)))


def _partial(path: Path) -> Path:
    return path.with_name(path.name + PARTIAL)


@contextmanager
def begun_folder(path: Path, numbered: bool = False) -> Iterator[Path]:
    """The folder of a new training; what it has made there is removed if it fails before anything is logged.

    Args:
        path: of the new folder; what it already holds stays.
        numbered: if it holds a run, take the next of ``path_2``, ``path_3`` … that does not.

    Raises:
        ConfigError: if it already holds a run or cannot be written to.
    """
    for one in _numbered(path):
        before = {*one.iterdir()} if one.is_dir() else None
        try:
            create_run_folder(one)
        except TakenFolderError:
            if not numbered:
                raise
        else:
            path = one
            break
    try:
        yield path
    except BaseException:
        if path.is_dir() and not _has_logged(path):
            _remove({*path.iterdir()} - (before or set()))
            if before is None:
                path.rmdir()
        raise


def _has_logged(path: Path) -> bool:
    """Whether a training has logged anything."""
    columns = (path / TRAJECTORIES / f"{name}.npy" for name in COLUMNS)
    return (path / METRICS).exists() or any(column.exists() for column in columns) or _frames_in_log(path) > 0


def _frames_in_log(path: Path) -> int:
    try:
        return int(read_json(path / TRAJECTORIES / ABOUT_LOG)["frames"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0


def _remove(parts: Iterable[Path]) -> None:
    for part in parts:
        if part.is_dir():
            shutil.rmtree(part, ignore_errors=True)
        else:
            part.unlink(missing_ok=True)
