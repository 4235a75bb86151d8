"""Ends a failed training with a one-line error, and keeps everything logged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ibe_rl.config.command_line import command_on
from ibe_rl.envs.errors import GateError
from ibe_rl.runtime.operating_system import NO_ROOM
from ibe_rl.runtime.workers import LostWorkerError
from ibe_rl.storage.checkpoint import LATEST, load, save_state
from ibe_rl.storage.run_folder import CHECKPOINTS, SUMMARY, write_json
from ibe_rl.training.summary import summarise
from ibe_rl.types import ConfigError


@contextmanager
def nothing_lost(folder: Path, keep: Callable[[], None], frames: Callable[[], int]) -> Iterator[None]:
    """If the body fails, keep everything logged and say how to resume.

    Errors that no user can fix are raised again with a note.

    Args:
        folder: of the run.
        keep: flushes the log to disk.
        frames: frames logged so far.

    Raises:
        ConfigError: if a loss or weight is NaN or infinite, a file cannot be written or the folder is gone.
    """
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:
        with suppress(Exception):  # the disk may be full
            keep()
        go_on = how_to_go_on(folder) if frames() else "train again"
        if not folder.is_dir():
            raise ConfigError(
                f"run_dir={folder}: it was moved or deleted, the training has ended at {frames():,} frames; allowed is "
                "a folder that stays; one that was moved can be resumed where it is, with resume=DIR"
            ) from None
        if isinstance(error, FloatingPointError):
            raise ConfigError(
                f"learning from the frames after {frames():,} gave {error}, the training has ended; "
                f"{go_on} with a smaller agent.learning_rate or agent.reward_scale"
            ) from None
        if isinstance(error, OSError) and _is_in(error.filename, folder):
            remedy = "make room" if error.errno in NO_ROOM else "let it be written"
            raise ConfigError(
                f"{error.filename} cannot be written ({error.strerror}), the training has ended at {frames():,} "
                f"frames; {remedy}, then {go_on}"
            ) from None
        if frames():
            error.add_note(f"What was logged is in {folder}; {go_on}")
        raise


@contextmanager
def resumable(run: Any) -> Iterator[None]:
    """If a worker or the environment fails between two batches, save the current state and say how to resume.

    Raises:
        LostWorkerError: with the command that resumes the run.
        GateError: with the same; summary.json has it as ``failure``.
    """
    try:
        yield
    except LostWorkerError as error:
        if not run.log.frames:
            raise LostWorkerError(f"{error}; nothing had been collected yet, start the run again") from None
        raise LostWorkerError(f"{error}; {_saved(run, 'to go on')}") from None
    except GateError as error:
        if not run.log.frames:
            raise
        told = _saved(run, "to go on once this is mended")
        ended = {"stopped_early": True, "failure": str(error)}
        write_json(run.folder / SUMMARY, summarise(run, {}) | ended)
        raise GateError(f"{error}; {told}") from None


def _saved(run: Any, purpose: str) -> str:
    """Save the current state; returns how to resume it."""
    save_state(run.folder, run.state_dict())
    return f"the run is saved as of {run.log.frames:,} frames, {purpose}: {command_on(run.folder, 'train', 'resume')}"


def how_to_go_on(folder: Path) -> str:
    """The command that resumes a run from its newest state."""
    try:
        frames = load(folder / CHECKPOINTS / LATEST)["frames"]
    except (ConfigError, KeyError, TypeError):
        return "train again: no state was saved"
    command = command_on(folder, "train", "resume")
    return f"resume its saved state of {frames:,} frames: {command}"


def _is_in(filename: object, folder: Path) -> bool:
    return isinstance(filename, str) and Path(filename).absolute().is_relative_to(folder.absolute())
