"""The runs of a sweep: name, folder and state of each."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from ibe_rl.storage.checkpoint import LATEST
from ibe_rl.storage.folder_lock import hold_folder
from ibe_rl.storage.run_folder import CHECKPOINTS, CONFIG, NOT_IN_NAMES, OVERRIDES, REPLACED, SUMMARY
from ibe_rl.types import ConfigError
from ibe_rl.view.viewer import overrides_of

RUN_FINISHED, UNFINISHED, NEW = "finished", "unfinished", "new"
"""State of a run's folder: done; resumable from a checkpoint; not begun, or begun without a checkpoint."""
DONE, DONE_BEFORE, FAILED, STOPPED, NOT_BEGUN = "finished", "finished before", "failed", "stopped", "not begun"
"""Outcomes of a run in a sweep."""
OUTPUT = "output.log"
"""File in the folder of a run with all that it printed."""
NAME_LENGTH = 100


@dataclass(frozen=True)
class Job:
    """A run of a sweep.

    Attributes:
        name: the settings in which it differs from the others, as ``agent=ppo, seed=1``.
        folder: of the run.
        overrides: its settings as on a command line.
        total_frames: frames to train for.
    """

    name: str
    folder: Path
    overrides: tuple[str, ...]
    total_frames: int


@dataclass(frozen=True)
class Outcome:
    """The outcome of a job; of a failed one with its last line of output."""

    job: Job
    became: str
    why: str = ""


def plan(sweep: Path, asked: Sequence[Sequence[str]], total_frames: Sequence[int], first: int = 0) -> list[Job]:
    """Assign every run its name and folder; a run begun earlier keeps its folder.

    Args:
        sweep: the folder of the sweep.
        asked: the overrides of each run.
        total_frames: of each run.
        first: number of the first run.

    Raises:
        ConfigError: if a folder holds a run with other settings.
    """
    begun = {_settings(overrides_of(run)): run for run in sweep.glob("*") if (run / OVERRIDES).is_file()}
    common = set.intersection(*(set(overrides) for overrides in asked))
    jobs = []
    for number, overrides in enumerate(asked, start=first):
        differs = [one.lstrip("+") for one in overrides if one not in common and key_of(one) not in NOT_IN_NAMES]
        mine = _settings(as_settings(overrides))
        new = sweep / _safe("_".join([str(number), *differs]))
        folder = begun.get(mine, new)
        if folder == new and (new / OVERRIDES).is_file() and mine not in begun:
            raise ConfigError(
                f"run_dir={sweep}: {new.name} in it is a run with other settings ({_other(new, mine)}); "
                "allowed is the command that made the sweep, with more values if need be, or a new folder"
            )
        jobs.append(Job(", ".join(differs) or new.name, folder, tuple(overrides), total_frames[number - first]))
    return jobs


def as_settings(overrides: Sequence[str]) -> dict[str, str]:
    """Command-line overrides as keys and values."""
    return {key: value for key, _, value in (one.lstrip("+").partition("=") for one in overrides)}


def key_of(override: str) -> str:
    """The key of an override."""
    return override.lstrip("+").partition("=")[0]


def _settings(given: Mapping[str, str]) -> frozenset[tuple[str, str]]:
    """The settings that identify a run."""
    return frozenset((key, value) for key, value in given.items() if key not in NOT_IN_NAMES)


def _other(folder: Path, mine: frozenset[tuple[str, str]]) -> str:
    theirs = _settings(overrides_of(folder))
    return ", ".join(f"{key}={value}" for key, value in sorted(theirs - mine) or sorted(mine - theirs))


def _safe(name: str) -> str:
    """A folder name of limited length that needs no quotes in a shell."""
    return re.sub(r"[^\w.=+-]+", "-", name)[:NAME_LENGTH].strip("-")


def state_of(run: Path) -> str:
    """The state of a run: ``RUN_FINISHED``, ``UNFINISHED`` or ``NEW``.

    Raises:
        ConfigError: if its summary cannot be read.
    """
    summary = read_summary(run)
    if summary is not None and not summary.get("stopped_early"):
        return RUN_FINISHED
    return UNFINISHED if (run / CHECKPOINTS / LATEST).is_file() else NEW


def read_summary(run: Path) -> dict[str, Any] | None:
    """The summary of a run, None without one.

    Raises:
        ConfigError: if it cannot be read.
    """
    path = run / SUMMARY
    try:
        found = json.loads(path.read_text())
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not the readable summary of a run ({error})") from None
    if not isinstance(found, dict):
        raise ConfigError(f"{path}: not the readable summary of a run (no object)")
    return found


def make_way(run: Path) -> Path | None:
    """Move the folder of a run that has to start over to where runs are not searched for.

    Returns:
        the new path; None if there was no run.

    Raises:
        ConfigError: if the run is training.
    """
    if not (run / CONFIG).is_file():
        return None
    with hold_folder(run):
        aside = next(path for n in count(1) if not (path := run.parent / REPLACED / f"{run.name}_{n}").exists())
        aside.parent.mkdir(exist_ok=True)
        run.rename(aside)
    return aside


def last_line(output: Path, begins: int = 0) -> str:
    """The last line of a file after byte ``begins``: where a failed program gives its reason."""
    with output.open("rb") as stream:
        stream.seek(begins)
        lines = stream.read().decode(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "no output")
