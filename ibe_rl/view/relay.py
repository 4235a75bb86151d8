"""Serve a recording live in rerun's web viewer while it grows, from a process of its own that a ``Relay`` starts.

The trainer writes a file; the relay follows that file and pipes it into the rerun server. Whatever hangs or
dies on the way to the browser, the trainer is not waiting for it. ``python -m ibe_rl.viewer`` opens runs by hand.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Self

from ibe_rl.runtime.installation import pasted
from ibe_rl.runtime.operating_system import has_desktop, is_stopped
from ibe_rl.runtime.ports import HOST, is_served, reserved
from ibe_rl.runtime.workers import ending
from ibe_rl.types import ConfigError
from ibe_rl.view.address import Ports, choose_ports, invitation, page
from ibe_rl.view.server import HANG_S, MOMENT_S, ViewerServer, end_process

CHUNK_BYTES = 1 << 18
PAGE_STARTS_S = 60.0
"""How long the page may take to answer where somebody waits for it."""
DRAIN_S = 2.0
"""How long the rest of the recording may take to reach the server once the relay is asked to end."""
News = Callable[[], list[str]]
"""What there is to say of the live view, each line once."""
LOG = "viewer.log"
SAYS = "relay: "
"""What a line of ``LOG`` begins with that the trainer is to pass on."""
SERVES = "the relay has started the server"
"""The line of ``LOG`` after which whatever answers on the ports is the relay's own server."""
PORT_TAKEN = 3
"""Exit status of a relay that found another program on one of its ports."""


def rerun_binary() -> Path:
    """Find the viewer itself; the ``rerun`` on the path is a script around it that would leave it orphaned.

    Raises:
        RuntimeError: if it is not installed.
    """
    package = find_spec("rerun_cli")
    binary = Path(package.origin).parent / "rerun" if package and package.origin else None
    if binary is None or not binary.exists():
        raise RuntimeError("the rerun viewer is not installed: pip install rerun-sdk")
    return binary


class Relay:
    """The trainer's side: a process that serves ``recording`` until it is closed or the trainer is gone.

    Where another program has taken a port meanwhile that was not asked for by its number, it serves on another one.

    Args:
        recording: the file, which may not be there yet.
        ports: from ``choose_ports``.
        browser: opens the page in the browser as soon as it answers.

    Raises:
        RuntimeError: if the viewer is not installed or the process cannot be started.
    """

    def __init__(self, recording: Path, ports: Ports, browser: bool = False) -> None:
        rerun_binary()
        self._recording, self._ports, self._browser = recording, ports, browser
        self._answered = self._told = False
        self._process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        numbers = [("--grpc-port", self._ports.grpc), ("--web-port", self._ports.web), ("--parent", os.getpid())]
        options = [str(part) for pair in numbers for part in pair]
        command = [sys.executable, "-m", "ibe_rl.view.relay", str(self._recording), *options]
        try:
            with (self._recording.parent / LOG).open("wb") as log:
                return subprocess.Popen(  # noqa: S603 - our own module
                    command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
                )  # in a session of its own, so that Ctrl-C reaches the trainer only
        except OSError as error:
            raise RuntimeError(f"the live view cannot be started: {error}") from error

    def _elsewhere(self) -> None:
        """Start again on other ports where one was taken that any other can stand in for."""
        if self._process.poll() == PORT_TAKEN:
            with suppress(ConfigError, RuntimeError):  # asked for by its number, or no second process: it has ended
                self._ports = choose_ports(*self._ports.asked)
                self._process = self._started()

    def alive(self) -> bool:
        """True while the recording is served, or is about to be."""
        self._elsewhere()
        return self._process.poll() is None

    def news(self) -> list[str]:
        """The address once it answers, and a line once nobody can watch any more; waits for nothing."""
        self._elsewhere()
        arrived = self._arrival()
        trouble = None if self._told else self._trouble()
        if trouble is None:
            return arrived
        self._told = True
        return [
            *arrived,
            f"warning: the live view has ended: {trouble}; training goes on and the recording is written all the "
            f"same, look at it with: {pasted('view', str(self._recording.parent.absolute()))}",
        ]

    def wait(self) -> list[str]:
        """The news when the page answers, or cannot any more."""
        until = time.monotonic() + PAGE_STARTS_S
        while self.alive() and not self._serves() and time.monotonic() < until:
            time.sleep(MOMENT_S)
        return self.news()

    def _serves(self) -> bool:
        started = SERVES in self._log()  # until then another program may answer there
        return started and is_served(self._ports.web) and is_served(self._ports.grpc)

    def _arrival(self) -> list[str]:
        if self._answered or not self._serves():
            return []
        self._answered = True
        if self._browser:
            webbrowser.open(page(self._ports))
        return [invitation(self._ports)]

    def _trouble(self) -> str | None:
        if not self.alive():
            return self._said() or f"its process has ended ({ending(self._process.returncode)})"
        if is_stopped(self._process):
            return "its process has been stopped"
        return self._said()

    def _said(self) -> str | None:
        """The last line that the relay has left for the trainer."""
        return next((line.partition(SAYS)[2] for line in reversed(self._log()) if SAYS in line), None)

    def _log(self) -> list[str]:
        """The last lines of the relay and its server; none where they cannot be read."""
        try:
            with (self._recording.parent / LOG).open("rb") as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - 4096))
                return log.read().decode(errors="replace").splitlines()
        except OSError:
            return []

    def close(self) -> None:
        """Serve what is written so far, then end; a second call does nothing."""
        end_process(self._process, 2 * DRAIN_S + 2)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _say(line: str) -> None:
    """Leave a line for the trainer, or for whoever started the relay."""
    sys.stderr.write(f"{SAYS}{line}\n")
    sys.stderr.flush()


class _Stop:
    """Asked to end by a signal, or because the parent is gone."""

    def __init__(self, parent: int | None) -> None:
        self._parent = parent
        self._asked_at: float | None = None
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._ask)

    def _ask(self, *_: object) -> None:
        self._asked_at = self._asked_at or time.monotonic()

    def now(self, behind: bool) -> bool:
        """True when it is time to end; while the server is ``behind`` it gets ``DRAIN_S`` more."""
        if self._parent is not None and os.getppid() != self._parent:
            return True
        return self._asked_at is not None and not (behind and time.monotonic() - self._asked_at < DRAIN_S)


def relay(recording: Path, ports: Ports, stop: _Stop) -> int:
    """Feed a recording to a server until asked to stop.

    Returns:
        the exit status: 1 if the server has ended, ``PORT_TAKEN`` if another program has one of the ports.
    """
    while not recording.exists():
        if stop.now(behind=False):
            return 0
        time.sleep(MOMENT_S)
    with reserved(ports.grpc, ports.web) as taken:
        if taken:
            _say(f"port {taken[0]} was free, but is taken now")  # the server would go on without it and say nothing
            return PORT_TAKEN
        return _serve(recording, ports, stop)


def _serve(recording: Path, ports: Ports, stop: _Stop) -> int:
    address = ["--bind", HOST, "--port", str(ports.grpc), "--web-viewer-port", str(ports.web)]
    server = ViewerServer([str(rerun_binary()), "-", "--serve-web", *address, "--server-memory-limit", "512MiB"])
    sys.stderr.write(f"{SERVES}\n")
    sys.stderr.flush()
    try:
        follow(recording, server, stop)
        if server.alive():
            return 0
        _say(f"the viewer's server has ended ({server.ending()})")
        return 1
    finally:
        server.stop()


def follow(recording: Path, server: ViewerServer, stop: _Stop) -> None:
    """Pass on what is in the file, then what is added to it; never more of it in memory than ``CHUNK_BYTES``."""
    pending, told = b"", False
    with recording.open("rb") as file:
        while server.alive():
            pending = pending or file.read(CHUNK_BYTES)
            if stop.now(behind=bool(pending)):
                return
            if not told and server.hangs():
                told = True
                _say(f"the viewer's server hangs, it has taken nothing for {HANG_S:.0f} s")
            if pending:
                pending = server.feed(pending)
            else:
                time.sleep(MOMENT_S)


def _main(arguments: Sequence[str] | None = None) -> int:
    """Be the process that a ``Relay`` started."""
    what = "Started by the trainer; to open a run: python -m ibe_rl.viewer RUN"
    parser = argparse.ArgumentParser(prog="python -m ibe_rl.view.relay", description=what)
    parser.add_argument("recording", type=Path)
    for number in ("--grpc-port", "--web-port", "--parent"):
        parser.add_argument(number, type=int, required=True)
    asked = parser.parse_args(arguments)
    return relay(asked.recording, Ports(asked.grpc_port, asked.web_port), _Stop(asked.parent))


def wants_browser(choice: str) -> bool:
    """Whether to open the page: ``viewer.open``, where "auto" asks for a terminal on a desktop."""
    return choice == "always" or (choice == "auto" and has_desktop() and sys.stdout.isatty())


def serve_live(
    recording: Path, ports: Ports, owned: ExitStack, say: Callable[[str], None], browser: bool = False
) -> News:
    """Start the process that serves the recording while it grows; without it training goes on all the same.

    Returns:
        what there is to say of it from now on, the address first.
    """
    try:
        relay = owned.enter_context(Relay(recording, ports, browser))
    except RuntimeError as reason:
        say(f"warning: no live view, the recording is written all the same: {reason}")
        return list
    return relay.news


if __name__ == "__main__":
    sys.exit(_main())
