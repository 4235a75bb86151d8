"""The runs of a sweep: what each is called, where it goes, and what has become of it so far."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from ibe_rl.storage.checkpoint import LATEST
from ibe_rl.storage.run_folder import CHECKPOINTS, CONFIG, NOT_IN_NAMES, OVERRIDES, REPLACED, SUMMARY, hold_folder
from ibe_rl.types import ConfigError
from ibe_rl.view.viewer import overrides_of

FINISHED, UNFINISHED, NEW = "finished", "unfinished", "new"
"""What a run is found to be: done; begun and with a state to go on from; not begun, or without such a state."""
DONE, DONE_BEFORE, FAILED, STOPPED, NOT_BEGUN = "finished", "finished before", "failed", "stopped", "not begun"
"""What becomes of a run in a sweep."""
OUTPUT = "output.log"
"""What a run of a sweep prints, in its folder."""
NAME_LENGTH = 100


@dataclass(frozen=True)
class Job:
    """A run that a sweep asks for.

    Attributes:
        name: the settings in which it differs from the others, as ``agent=ppo, seed=1``.
        folder: of the run.
        overrides: its settings as on a command line.
        total_frames: where it ends.
    """

    name: str
    folder: Path
    overrides: tuple[str, ...]
    total_frames: int


@dataclass(frozen=True)
class Outcome:
    """What became of a job, and of a failed one its last line."""

    job: Job
    became: str
    why: str = ""


def plan(sweep: Path, asked: Sequence[Sequence[str]], total_frames: Sequence[int], first: int = 0) -> list[Job]:
    """Give every run its name and its folder; one that the sweep has begun before keeps its own.

    Args:
        sweep: the folder of the sweep.
        asked: the overrides of each run.
        total_frames: of each run.
        first: the number of the first one.

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
    """Overrides as on a command line, by their keys."""
    return {key: value for key, _, value in (one.lstrip("+").partition("=") for one in overrides)}


def key_of(override: str) -> str:
    """The setting that an override names."""
    return override.lstrip("+").partition("=")[0]


def _settings(given: Mapping[str, str]) -> frozenset[tuple[str, str]]:
    """What makes a run the one that it is."""
    return frozenset((key, value) for key, value in given.items() if key not in NOT_IN_NAMES)


def _other(folder: Path, mine: frozenset[tuple[str, str]]) -> str:
    theirs = _settings(overrides_of(folder))
    return ", ".join(f"{key}={value}" for key, value in sorted(theirs - mine) or sorted(mine - theirs))


def _safe(name: str) -> str:
    """A name that needs no quotes on any command line, and is not too long for a folder."""
    return re.sub(r"[^\w.=+-]+", "-", name)[:NAME_LENGTH].strip("-")


def state_of(run: Path) -> str:
    """What has become of a run: ``FINISHED``, ``UNFINISHED`` or ``NEW``.

    Raises:
        ConfigError: if its summary cannot be read.
    """
    summary = read_summary(run)
    if summary is not None and not summary.get("stopped_early"):
        return FINISHED
    return UNFINISHED if (run / CHECKPOINTS / LATEST).is_file() else NEW


def read_summary(run: Path) -> dict[str, Any] | None:
    """Its summary, None if it has none (yet).

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
    """Move what is left of a run that has to begin anew to where nothing looks for runs.

    Returns:
        where to; None if there was nothing.

    Raises:
        ConfigError: if it is training.
    """
    if not (run / CONFIG).is_file():
        return None
    with hold_folder(run):
        aside = next(path for n in count(1) if not (path := run.parent / REPLACED / f"{run.name}_{n}").exists())
        aside.parent.mkdir(exist_ok=True)
        run.rename(aside)
    return aside


def last_line(output: Path, begins: int = 0) -> str:
    """The last line of a file from some byte on, in which a program that failed says why."""
    with output.open("rb") as stream:
        stream.seek(begins)
        lines = stream.read().decode(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
