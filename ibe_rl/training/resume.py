"""Resumes a stopped or killed run: its settings, its state, and what it logged after that state."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

from ibe_rl.config.command_line import changed
from ibe_rl.config.limits import check, kept_settings
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.instructors import is_live, is_resumable
from ibe_rl.storage.checkpoint import BEST, BETWEEN, EVALUATED, LATEST, PREDICTOR, link, load, policies
from ibe_rl.storage.run_folder import (
    CHECKPOINTS,
    CONFIG,
    EVALUATION,
    FIGURES,
    LESSON,
    METRICS,
    RECORDING,
    REFRESHES,
    REPLACED,
    SUMMARY,
    is_run,
    read_rows,
    refuse_special_files,
    write_rows,
)
from ibe_rl.types import ConfigError

State = dict[str, Any]
DOES_NOT_FIT = (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError, ArithmeticError)
PARTS = ("agent", "log", "development", "obedience", "predictor", "recorder", "random")
"""What a checkpoint holds the state of."""


def take_up(cfg: TrainConfig) -> tuple[TrainConfig, State]:
    """Read the run that ``cfg.resume`` names, without writing.

    Returns:
        Its settings, overridden by those given with ``resume``, and its state.

    Raises:
        ConfigError: if it cannot be resumed, or not with these settings.
    """
    folder = Path(cfg.resume or "")
    if not is_run(folder):
        raise ConfigError(f"resume={folder}: not a run folder (it has no {CONFIG}); allowed is one that train.py made")
    refuse_special_files(folder)
    saved = load_config(folder / CONFIG, TrainConfig)
    if not is_resumable(saved.instructor):
        raise ConfigError(
            f"resume={folder}: instructor={saved.instructor.kind} repeats a session from its beginning; train it anew"
        )
    going_on = replace(saved, stop_after_frames=None)  # it has already stopped there
    config = replace(changed(going_on, [*kept_settings(going_on), "experiment"]), run_dir=str(folder), resume=None)
    check(config)
    state = read_state(folder, cfg.resume_from)
    if state["frames"] >= config.total_frames:
        raise ConfigError(
            f"resume={folder}: it has had its {config.total_frames:,} frames; allowed with it is a larger total_frames"
        )
    return config, without_episodes(state) if is_live(config.instructor) else state


def read_state(folder: Path, name: str) -> State:
    """Read a checkpoint of a run, ``latest`` or ``best``.

    Raises:
        ConfigError: if there is none, it is damaged, or of another version.
    """
    path = folder / CHECKPOINTS / (LATEST if name == "latest" else BEST)
    if not path.is_file():
        raise ConfigError(
            f"resume={folder}: it has no {CHECKPOINTS}/{path.name}, it ended before the first one; train it anew"
        )
    other = folder / CHECKPOINTS / BEST
    allowed = f"allowed is resume_from=best ({other.name})" if name == "latest" and other.is_file() else "train it anew"
    try:
        state = load(path)
    except ConfigError as error:
        raise ConfigError(f"{error}; {allowed}") from None
    if (
        not isinstance(state, dict)
        or not {"frames", "counts", *PARTS} <= state.keys()
        or type(state["frames"]) is not int
    ):
        raise ConfigError(f"{path}: not a state of this version of ibe_rl to resume from; {allowed}")
    return state


@contextmanager
def must_fit(folder: Path) -> Iterator[None]:
    """Report errors of the body as a state that does not fit.

    Raises:
        ConfigError: naming the run.
    """
    try:
        yield
    except ConfigError:
        raise
    except DOES_NOT_FIT as error:
        first = str(error).splitlines()[0][:200] if str(error) else ""
        raise ConfigError(
            f"resume={folder}: its state does not fit this version of ibe_rl or its own settings "
            f"({type(error).__name__}: {first}); train it anew"
        ) from None


def without_episodes(state: State) -> State:
    """The state without partial episodes: a human cannot continue in the middle of one."""
    log, agent = dict(state["log"]), dict(state["agent"])
    log["ended"] = [ended + bool(steps) for ended, steps in zip(log["ended"], log["open_steps"], strict=True)]
    log["open_steps"], log["open"] = [0] * len(log["open_steps"]), {}
    if "unfinished" in agent:
        agent["unfinished"] = None
    return {**state, "log": log, "agent": agent, "obedience": {}}


def clear_way(folder: Path, state: State) -> str:
    """Move aside what was logged after the state, as it will be logged again; nothing is deleted.

    Returns:
        A message for the user.

    Raises:
        ConfigError: if the folder cannot be written to.
    """
    try:
        aside = _set_aside(folder, state)
        if _frames(folder / CHECKPOINTS / LATEST) != state["frames"]:
            link(folder / CHECKPOINTS, BEST, LATEST)
    except OSError as error:
        raise ConfigError(f"resume={folder}: allowed is a folder that can be written to ({error.strerror})") from None
    moved = f"; what it had logged after that is in {aside}" if aside else ""
    return f"going on at {state['frames']:,} frames{moved}"


def _frames(path: Path) -> int | None:
    """Frames of a saved state; None if it is damaged."""
    with suppress(ConfigError, KeyError, TypeError):
        frames: int = load(path)["frames"]
        return frames
    return None


def _set_aside(folder: Path, state: State) -> Path | None:
    """Move later files; returns the destination, None if there were none."""
    frames = state["frames"]
    aside = next(path for n in count(1) if not (path := folder / REPLACED / str(n)).exists())
    late = [path for at, path in policies(folder / CHECKPOINTS, EVALUATED, BETWEEN).items() if at > frames]
    late += [path for at, path in policies(folder / CHECKPOINTS, PREDICTOR).items() if at > frames]
    late += [path for path in (folder / REFRESHES).glob("*.json") if int(path.stem) > frames]
    late += [path for name in (SUMMARY, EVALUATION, FIGURES, LESSON) if (path := folder / name).exists()]
    late += [] if state["recorder"] else [path for path in [folder / RECORDING] if path.exists()]
    rows = read_rows(folder / METRICS, above_frames=frames) if frames or (folder / METRICS).exists() else []
    if late or rows:
        aside.mkdir(parents=True)
    if rows:
        write_rows(aside / METRICS, rows)
    for path in late:
        path.rename(aside / path.name)
    return aside if late or rows else None
