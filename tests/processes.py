"""Scripts as a user runs them, and the processes that they start."""

import importlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from copies import Script
from hydra._internal.hydra import Hydra
from view_data import eventually

from ibe_rl.config.command_line import run_script
from ibe_rl.runtime.operating_system import children_of, command_line_of
from ibe_rl.storage.run_folder import METRICS, read_rows

ROOT = Path(__file__).parent.parent
SMALL = [
    "collect.processes=1",
    "collect.envs_per_process=8",
    "collect.steps_per_batch=128",
    "total_frames=6000",
    "refresh_every_frames=2000",
    "eval_every_frames=3000",
    "eval_episodes=5",
    "mapping.horizon_steps=20",
    "mapping.delay_steps=0",  # the search takes a quarter of such a training
    "agent.hidden=[16]",
    *("agent.mirror=false", "agent.noise_steps=1"),  # many tests know what becomes of this training
    "log.capacity_frames=10000",
]

SMALL_RUN = [*SMALL, "mapping.spans_steps=[10]", "mapping.meaning=assumed"]
"""With two spans. Its few episodes cannot tell what the words mean."""


def call(script: str, *arguments: str) -> None:
    """Run a script in this process, the way its ``__main__`` does.

    Hydra composes the settings once and not twice: the other time is to look for hydra.mode, which none of them sets.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [f"{script}.py", *arguments])
        patch.setattr(Hydra, "get_mode", lambda *_, **__: None)
        run_script(importlib.import_module(script).main, ROOT / "configs", script)


def gone(pid: int) -> bool:
    """True if the process has ended, whether or not somebody has asked for its exit status."""
    return process_state(pid) in ("", "Z")


def process_state(pid: int) -> str:
    """One letter, as ``ps`` has it; empty if there is no such process."""
    if sys.platform != "linux":
        command = ["ps", "-o", "state=", "-p", str(pid)]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()[:1]
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return ""


def server_of(relay_pid: int) -> int:
    """The viewer's server that a relay has started; until it is that, its process is a copy of the relay."""
    assert eventually(
        lambda: [one for one in children_of(relay_pid) if command_line_of(one) != command_line_of(relay_pid)]
    )
    return children_of(relay_pid)[0]


def start(*arguments: str, cwd: Path = ROOT, **variables: str) -> Script:
    """Start ``python ARGUMENTS``, a file or ``-c CODE``, in a process group of its own."""
    return Script(arguments, cwd, os.environ | {"PYTHONUNBUFFERED": "1"} | variables)


def rows_in(folder: Path) -> int:
    """How many rows of metrics.csv a run has by now."""
    return len(read_rows(folder / METRICS)) if (folder / METRICS).exists() else 0


@contextmanager
def partial_episodes(folder: Path, *settings: str, within_s: float = 120.0, **variables: str) -> Iterator[Script]:
    """A training that has its first rows, and is killed at the end if it still trains."""
    process = start("train.py", *settings, f"run_dir={folder}", **variables)
    try:
        eventually(lambda: rows_in(folder) > 2 or process.poll() is not None, within_s)
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def assert_whole(recording: Path) -> None:
    """The recording has its footer, so it was closed in order."""
    subprocess.run([Path(sys.executable).parent / "rerun", "rrd", "verify", recording], check=True)
