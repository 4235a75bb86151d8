"""Open runs again in rerun's web viewer, several side by side with their curves in the same plots.

    ibe-rl view [RUN ...] [--grpc-port N] [--web-port N]      or python -m ibe_rl.viewer

RUN is the folder of a run or of a sweep, or a recording, finished or still growing. Without one the newest run below
``runs/`` is opened. The messages of all recordings are copied into one temporary file, so that one server with one
address is enough for any number of runs.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

from ibe_rl.runtime.installation import typed
from ibe_rl.runtime.printed import prepare_output, visible
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.storage.run_folder import (
    CONFIG,
    METRICS,
    NOT_IN_NAMES,
    OVERRIDES,
    RECORDING,
    find_run,
    read_overrides,
    refuse_special_files,
)
from ibe_rl.types import ConfigError
from ibe_rl.view.address import GRPC_PORT, WEB_PORT, Ports, choose_ports
from ibe_rl.view.overlay import Overlay
from ibe_rl.view.recording_file import END, HEAD_BYTES, MAGIC, next_message
from ibe_rl.view.relay import LOG, Relay, wants_browser

_RUNS = Path("runs")
_POLL_S = 0.5


def runs_at(place: Path) -> list[Path]:
    """The run or recording at ``place``, or the runs of the sweep there in the order of their numbers.

    Raises:
        ConfigError: if there is none.
    """
    if place.is_file():
        return [place.parent if place.name == RECORDING else place]
    if _holds_run(place):
        refuse_special_files(place)
        return [place]
    below = [folder for folder in place.glob("*") if _holds_run(folder)]
    if not below:
        allowed = "the folder of a run or of a sweep that train.py made, or a recording"
        raise ConfigError(f"{place}: nothing to open; allowed is {allowed}")
    for folder in below:
        refuse_special_files(folder)
    return sorted(below, key=lambda folder: (int("0" + re.sub(r"\D.*", "", folder.name)), folder.name))


def _holds_run(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (CONFIG, RECORDING, METRICS))


def _newest() -> Path:
    try:
        return find_run(None, _RUNS)
    except ConfigError:
        raise ConfigError(f"there is no run below {_RUNS}/; train one, or name one") from None


def recording_of(run: Path) -> Path:
    """Where the recording of a run is, if it has one; ``run`` may be a recording itself."""
    return run / RECORDING if run.is_dir() else run


def with_curves(runs: Mapping[str, Path]) -> dict[str, Path]:
    """``metrics.csv`` of the runs to be laid over each other: none for one run, unless it has nothing else.

    Raises:
        ConfigError: if there is nothing at all to show.
    """
    metrics = {name: run / METRICS for name, run in runs.items() if run.is_dir()}
    recorded = any(recording_of(run).exists() for run in runs.values())
    if not recorded and not any(path.exists() for path in metrics.values()):
        raise ConfigError(f"{next(iter(runs.values()))}: neither {RECORDING} nor {METRICS} is there (yet)")
    return metrics if len(metrics) > 1 or not recorded else {}


def run_names(runs: Sequence[Path]) -> list[str]:
    """Name runs after the settings in which they differ, else after their folders; no two alike."""
    given = [overrides_of(run) for run in runs]
    told = [overrides for overrides in given if overrides]
    keys = [key for key in dict.fromkeys(key for overrides in told for key in overrides) if key not in NOT_IN_NAMES]
    differ = [key for key in keys if len({overrides.get(key) for overrides in told}) > 1]
    names = [", ".join(f"{key}={overrides[key]}" for key in differ if key in overrides) for overrides in given]
    names = [name or run.stem for name, run in zip(names, runs, strict=True)]
    names = _told_apart(names, [f"{name} in {run.name}" for name, run in zip(names, runs, strict=True)])
    return _told_apart(names, [str(run) for run in runs])


def _told_apart(names: Sequence[str], longer: Sequence[str]) -> list[str]:
    counts = Counter(names)
    return [name if counts[name] == 1 else instead for name, instead in zip(names, longer, strict=True)]


def overrides_of(run: Path) -> dict[str, str]:
    """The settings that a run was started with; none if that cannot be told."""
    pairs = [one.lstrip("+").partition("=") for one in read_overrides(run / OVERRIDES)]
    return {key: value for key, _, value in pairs}


class Messages:
    """The messages of a recording that may still grow, or may not be there yet.

    Args:
        path: the recording.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._read, self._ended = path, 0, False

    def copy(self, to: BinaryIO) -> None:
        """Append the messages completed since the last call; the head too where ``to`` is still empty.

        Raises:
            ConfigError: if it is no recording.
        """
        if self._ended or not self._path.exists():
            return
        with self._path.open("rb") as file:
            size = self._path.stat().st_size
            if self._read == 0 and size >= HEAD_BYTES:
                self._copy_head(file, to)
            while self._read and not self._ended and self._copy_message(file, size, to):
                pass

    def _copy_head(self, file: BinaryIO, to: BinaryIO) -> None:
        head = file.read(HEAD_BYTES)
        if not head.startswith(MAGIC):
            raise ConfigError(
                f"{self._path}: not a recording of rerun; allowed is one that train.py or explain.py made"
            )
        if to.tell() == 0:
            to.write(head)
        self._read = HEAD_BYTES

    def _copy_message(self, file: BinaryIO, size: int, to: BinaryIO) -> bool:
        """Append the next message; False if it is not complete, or is the end."""
        found = next_message(file, self._read, size)
        if found is None:
            return False
        kind, end = found
        self._ended = kind == END
        if not self._ended:
            file.seek(self._read)
            to.write(file.read(end - self._read))
            self._read = end
        return not self._ended


def serve_runs(runs: Mapping[str, Path], ports: Ports) -> int:
    """Show runs until Ctrl-C; returns the exit status, 1 if the server died.

    Args:
        runs: name of each to its folder or recording.
        ports: from ``choose_ports``.

    Raises:
        ConfigError: if there is nothing to show, or a file is not what it should be.
        RuntimeError: if the server cannot be started.
    """
    curves = with_curves(runs)
    with StopRequest() as stop, TemporaryDirectory(prefix="ibe_rl_") as folder:
        shown, curves_file = Path(folder, "shown.rrd"), Path(folder, "overlay.rrd")
        parts = [Messages(recording_of(run)) for run in runs.values()]
        if curves:
            parts.append(Messages(curves_file))  # last, as the viewer opens on what came last
        with closing(Overlay(curves_file, curves)) as overlay, shown.open("wb") as file:
            append_new_messages(parts, file)
            with Relay(shown, ports, wants_browser("auto")) as relay:
                say(runs, relay.wait())
                while relay.alive() and not stop:
                    time.sleep(_POLL_S)
                    overlay.update()
                    append_new_messages(parts, file)
        if not stop:
            sys.stderr.write(f"the server has ended: {Path(folder, LOG).read_text().strip()}\n")
    return 0 if stop else 1


def append_new_messages(parts: Sequence[Messages], shown: BinaryIO) -> None:
    """Append what is new in the recordings to the file that is served."""
    for part in parts:
        part.copy(shown)
    shown.flush()


def say(runs: Mapping[str, Path], news: Sequence[str]) -> None:
    """Print which runs are open under which name, the address, and how to end."""
    lines = [*(visible(f"{name}: {run}") for name, run in runs.items()), *news]
    if len(runs) > 1:
        lines.append("  a click in the list on the left opens one run, a button at the top right shows the list again")
    sys.stdout.write("\n".join([*lines, "  Ctrl-C ends it\n"]))
    sys.stdout.flush()


def open_recordings(arguments: Sequence[str] | None = None) -> int:
    """Open runs from the command line until Ctrl-C."""
    prepare_output()
    parser = argparse.ArgumentParser(prog=typed("view"), description="Open runs in the browser.")
    what = "folder of a run or of a sweep, or a recording, finished or growing; default: the newest run below runs/"
    parser.add_argument("run", type=Path, nargs="*", help=what)
    parser.add_argument("--grpc-port", type=int, help=f"default {GRPC_PORT}, or a free one")
    parser.add_argument("--web-port", type=int, help=f"default {WEB_PORT}, or a free one")
    asked = parser.parse_args(arguments)
    try:
        places = asked.run or [_newest()]
        runs = list(dict.fromkeys(run.resolve() for place in places for run in runs_at(place)))
        return serve_runs(dict(zip(run_names(runs), runs, strict=True)), choose_ports(asked.grpc_port, asked.web_port))
    except (ConfigError, RuntimeError, OSError) as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        return 130
