"""What a fault of the live view costs the training: its frames a second before and after."""

from __future__ import annotations

import csv
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.child import ONE_THREAD
from benchmarks.levels import figure, plain
from benchmarks.ours import seconds
from benchmarks.plan import ROOT, Plan
from benchmarks.skill import Figures, Say
from ibe_rl.runtime.operating_system import children_of, command_line_of
from ibe_rl.storage.run_folder import METRICS, RECORDING
from ibe_rl.view.address import choose_ports

SCRIPT = """
from pathlib import Path
import train
from benchmarks.faults import fill_disk_at_signal
from ibe_rl.training import build
from ibe_rl.view import address, film, relay
from ibe_rl.config.command_line import run_script
{patch}
if __name__ == "__main__":
    fill_disk_at_signal()
    run_script(train.main, Path(train.__file__).parent / "configs", "train")
"""
"""train.py with something broken in it beforehand."""
NOT_INSTALLED = "relay.find_spec = lambda _: None"
PORTS = "build.choose_ports = lambda *_: address.Ports({grpc}, {web}, asked=({grpc}, {web}))"
WARNING = {
    "killed": "the live view has ended: the viewer's server has ended",
    "stopped": "the viewer's server hangs",
    "full_disk": "the recording cannot be written any more",
    "not_installed": "the rerun viewer is not installed",
    "port_taken": "taken",
}
"""A part of what train.py must say, or the fault was none."""
START_S = 60.0
"""How long a live view may take to start, on a machine that does much else."""
Fault = Callable[[int], None]


def live_view(trainer: int) -> tuple[int, int]:
    """The relay of a training and the viewer's server, once both have started.

    Raises:
        ValueError: if there is not one of each within ``START_S``.
    """
    end = time.monotonic() + START_S
    while True:
        relays = [child for child in children_of(trainer) if "ibe_rl.view.relay" in command_line_of(child)]
        servers = [one for relay in relays for one in children_of(relay) if "--serve-web" in command_line_of(one)]
        if len(relays) == len(servers) == 1:
            return relays[0], servers[0]
        if time.monotonic() > end or not children_of(trainer):
            raise ValueError(f"process {trainer}: {len(relays)} relays, {len(servers)} servers")
        time.sleep(0.1)


def fill_disk(trainer: int) -> None:
    """Let the files of a training grow no further than its recording is, and a little."""
    os.kill(trainer, signal.SIGUSR1)


def fill_disk_at_signal() -> None:
    """In the training: do what ``fill_disk`` asks for; only Linux could do it from outside."""
    [folder] = [Path(one.removeprefix("run_dir=")) for one in sys.argv if one.startswith("run_dir=")]

    def fill(*_: object) -> None:
        size = (folder / RECORDING).stat().st_size + 20_000
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    signal.signal(signal.SIGUSR1, fill)


FAULTS: dict[str, Fault] = {
    "none": lambda _: None,
    "killed": lambda trainer: os.kill(live_view(trainer)[1], signal.SIGKILL),
    "stopped": lambda trainer: os.kill(live_view(trainer)[1], signal.SIGSTOP),
    "full_disk": fill_disk,
}
"""What happens when half of the frames are flown."""
FROM_THE_START = ("not_installed", "port_taken")


def run(plan: Plan, say: Say) -> Iterator[Figures]:
    """Train with each fault in turn, as often as asked; yields the figures so far after each round."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in (*FAULTS, *FROM_THE_START)}
    for repeat in range(plan.repeats):
        say(f"faults, round {repeat + 1} of {plan.repeats}")
        for name, rates in found.items():
            rates.append(rate(plan, repeat, name))
            say(f"  {name}: {rates[-1][0]:,.0f} frames a second before, {rates[-1][1]:,.0f} after")
        yield figures(found)


def figures(found: dict[str, list[tuple[float, float]]]) -> Figures:
    """The second half of each run against its first; of what is there from the start, against an undisturbed run's."""
    made = []
    for name, rates in found.items():
        other = found["none"] if name in FROM_THE_START else rates
        side = 1 if name in FROM_THE_START else 0
        made.append(
            figure(f"faults_{name}", "frames/s", plain([after for _, after in rates]), plain([r[side] for r in other]))
        )
    return made


def rate(plan: Plan, seed: int, name: str) -> tuple[float, float]:
    """Frames a second of train.py in its first half and, with a fault, in its second.

    Raises:
        RuntimeError: if it failed, or did not say what happened.
    """
    sizes = plan.sizes
    frames = [f"total_frames={sizes.fault_frames}", f"refresh_every_frames={sizes.fault_frames // 8}"]
    with tempfile.TemporaryDirectory() as place, socket.socket() as holder:
        folder = Path(place) / "run"
        script = Path(place) / "script.py"
        script.write_text(SCRIPT.format(patch=_patch(name, holder)))
        output = Path(place) / "output"
        with output.open("w") as stream:
            process = subprocess.Popen(  # noqa: S603 - our own
                [sys.executable, script, *sizes.overrides, *frames, f"seed={seed}", f"run_dir={folder}", "viewer=live"],
                env=os.environ | ONE_THREAD | {"PYTHONPATH": str(ROOT), "RERUN_STRICT": "0"},
                stdout=stream,
                stderr=stream,
                cwd=ROOT,
            )
            half = _wait(process, folder, sizes.fault_frames // 2)
            if process.poll() is None:
                FAULTS.get(name, FAULTS["none"])(process.pid)
            status = process.wait()
        said = output.read_text()
        if status or said.count("warning") != (name in WARNING) or WARNING.get(name, "") not in said:
            raise RuntimeError(f"train.py with {name} ended with {status}:\n{said[-2000:]}")
        return rates(_rows(folder), half)


def rates(rows: list[dict[str, str]], half: int) -> tuple[float, float]:
    """Frames a second up to row ``half`` and from there on, without set-up and evaluations."""
    flown = [(int(row["frames"]), seconds(row)) for row in rows]
    parts = (flown[0], flown[half]), (flown[half], flown[-1])
    before, after = ((end[0] - begin[0]) / (end[1] - begin[1]) for begin, end in parts)
    return before, after


def _patch(name: str, holder: socket.socket) -> str:
    if name == "not_installed":
        return NOT_INSTALLED
    if name == "port_taken":
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        return PORTS.format(grpc=holder.getsockname()[1], web=choose_ports(None, None).web)
    return ""


def _wait(process: subprocess.Popen[bytes], folder: Path, frames: int) -> int:
    """Wait until so many frames are flown; returns the number of that row."""
    while process.poll() is None:
        rows = _rows(folder)
        if rows and int(rows[-1]["frames"] or 0) >= frames:
            return len(rows) - 1
        time.sleep(0.1)
    return 0


def _rows(folder: Path) -> list[dict[str, str]]:
    try:
        with (folder / METRICS).open() as stream:
            return [row for row in csv.DictReader(stream) if None not in row.values()]
    except FileNotFoundError:
        return []
