"""What can happen to the live view while a real training runs: it goes on, says so once, and ends by itself."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from copies import Script
from processes import ROOT, SMALL, assert_whole, gone, server_of, start
from rerun.chunk import RrdReader
from view_data import eventually, free_ports

from benchmarks.faults import NOT_INSTALLED, PORTS, SCRIPT, fill_disk
from ibe_rl.runtime.operating_system import children_of, command_line_of

FRAMES = 12_000
RUN = [
    *SMALL,
    *("viewer=live", f"total_frames={FRAMES}", "refresh_every_frames=2000", "eval_every_frames=12000"),
    *("eval_episodes=2", "explain_every_steps=50"),
]


@dataclass
class Training:
    """A training in a process of its own."""

    folder: Path
    process: Script

    def recording(self) -> Path:
        return self.folder / "recording.rrd"

    def refreshes(self) -> int:
        return len(list((self.folder / "refreshes").glob("*.json")))

    def live_view(self) -> list[int]:
        """The relay and the viewer's server."""
        [relay] = [one for one in children_of(self.process.pid) if "ibe_rl.view.relay" in command_line_of(one)]
        server = server_of(relay)
        assert eventually(lambda: "--serve-web" in command_line_of(server))
        return [relay, server]

    def ended(self, group: list[int], frames: int = FRAMES) -> str:
        """Wait for the end of a run that must end well and leave nothing running; what it printed."""
        output, _ = self.process.communicate(timeout=240)
        assert self.process.returncode == 0, output
        assert "Traceback" not in output, output
        assert json.loads((self.folder / "summary.json").read_text())["frames"] >= frames
        assert eventually(lambda: all(gone(pid) for pid in group))
        return output


def begin(folder: Path, patch: str = "", *overrides: str) -> Training:
    """Start a small training; ``patch`` is run before it, in its process."""
    ports = free_ports()
    numbers = [f"viewer.grpc_port={ports.grpc}", f"viewer.web_port={ports.web}"]
    script, settings = SCRIPT.format(patch=patch), [*RUN, *numbers, f"run_dir={folder}", *overrides]
    return Training(folder, start("-c", script, *settings, RERUN_STRICT="0", PYTHONPATH=str(ROOT)))


def the_warning(output: str) -> str:
    """The one warning in what was printed."""
    [line] = [line for line in output.splitlines() if "warning" in line.lower()]
    return line


@pytest.fixture
def training(tmp_path: Path) -> Iterator[Callable[..., Training]]:
    started: list[Training] = []

    def start(patch: str = "", *overrides: str, until_refreshes: int = 1) -> Training:
        started.append(begin(tmp_path / "run", patch, *overrides))
        assert eventually(lambda: started[0].refreshes() >= until_refreshes or started[0].process.poll() is not None)
        return started[0]

    yield start
    for one in started:
        if one.process.poll() is None:
            os.killpg(one.process.pid, signal.SIGKILL)
        one.process.wait()


START = Callable[..., Training]
SHORT = "total_frames=4000"
"""Enough where the fault is there from the start."""


def test_a_viewer_that_is_killed(training: START) -> None:
    run = training()
    relay, server = run.live_view()
    os.kill(server, signal.SIGKILL)
    warning = the_warning(run.ended([relay, server]))
    assert "the live view has ended: the viewer's server has ended (SIGKILL)" in warning
    assert "the recording is written all the same" in warning
    assert_whole(run.recording())


def test_a_viewer_that_is_stopped(training: START) -> None:
    run = training("", "total_frames=100000000")
    relay, server = run.live_view()
    os.kill(server, signal.SIGSTOP)
    assert eventually(lambda: "hangs" in (run.folder / "viewer.log").read_text())
    refreshes = run.refreshes()
    assert eventually(lambda: run.refreshes() >= refreshes + 2)  # on it goes
    run.process.send_signal(signal.SIGINT)
    warning = the_warning(run.ended([relay, server], frames=0))
    assert "the viewer's server hangs, it has taken nothing for 8 s" in warning
    assert_whole(run.recording())


def test_a_viewer_that_is_not_installed(training: START) -> None:
    run = training(NOT_INSTALLED, SHORT)
    warning = the_warning(run.ended([], frames=4000))
    assert "no live view, the recording is written all the same: the rerun viewer is not installed" in warning
    assert_whole(run.recording())


def test_a_port_that_somebody_else_takes_first(training: START) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        run = training(PORTS.format(grpc=port, web=free_ports().web), SHORT)
        assert f"port {port} was free, but is taken now" in the_warning(run.ended([], frames=4000))
    assert_whole(run.recording())


def test_a_disk_that_is_full(training: START) -> None:
    run = training(until_refreshes=2)
    fill_disk(run.process.pid)
    warning = the_warning(run.ended(run.live_view()))
    assert "the recording cannot be written any more (File too large)" in warning
    until = int(warning.partition("until frame ")[2].partition(" can")[0].replace(",", ""))
    frames = [
        frame
        for chunk in RrdReader(str(run.recording())).stream()
        if str(chunk.entity_path) in ("/curves/train/return_mean", "/vocabulary/centres")
        for frame in chunk.to_record_batch().to_pydict().get("frames", [])
    ]
    assert 2000 < until <= max(frames)


def test_an_error_on_the_way_to_the_recording(training: START) -> None:
    run = training("film.Film.send = lambda *_: 1 / 0", SHORT)
    warning = the_warning(run.ended([], frames=4000))
    assert "something could not be recorded (ZeroDivisionError: division by zero)" in warning
    assert_whole(run.recording())
