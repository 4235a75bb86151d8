"""The process of rerun's server as the relay sees it: fed through a pipe, alive, hanging or ended."""

from __future__ import annotations

import fcntl
import os
import select
import subprocess
import sys
import termios
import time

from ibe_rl.runtime.operating_system import killed_with_parent
from ibe_rl.runtime.workers import ending

MOMENT_S = 0.1
HANG_S = 8.0
"""Seconds without taking anything of what waits for it before the server counts as hung."""


class ViewerServer:
    """The process of rerun's server, fed through its standard input without waiting; it dies with this one.

    Args:
        command: of the process.
    """

    def __init__(self, command: list[str]) -> None:
        self._end, self._pipe = os.pipe()  # our copy of its end tells on every system how much waits there
        self._process = subprocess.Popen(  # noqa: S603 - the installed viewer
            command,
            stdin=self._end,
            start_new_session=True,
            env=os.environ | {"RUST_LOG": "warn"},
            preexec_fn=killed_with_parent(),  # also if the relay is killed
        )
        os.set_blocking(self._pipe, False)
        self._given = self._taken = 0
        self._taken_at = time.monotonic()

    def alive(self) -> bool:
        """True while it runs."""
        return self._process.poll() is None

    def ending(self) -> str:
        """How it has ended."""
        return ending(self._process.returncode)

    def hangs(self) -> bool:
        """True if it has taken nothing for ``HANG_S`` of what waits for it in the pipe."""
        waiting = int.from_bytes(fcntl.ioctl(self._end, termios.FIONREAD, bytes(4)), sys.byteorder)
        taken, now = self._given - waiting, time.monotonic()
        if not waiting or taken > self._taken:
            self._taken, self._taken_at = taken, now
        return now - self._taken_at > HANG_S

    def feed(self, data: bytes) -> bytes:
        """Hand over what the server takes within a moment; returns the rest."""
        if not self.alive() or not select.select([], [self._pipe], [], MOMENT_S)[1]:
            return data
        given = os.write(self._pipe, data)
        self._given += given
        return data[given:]

    def stop(self) -> None:
        """End it, even if it hangs."""
        end_process(self._process, 1)


def end_process(process: subprocess.Popen[bytes], timeout_s: float) -> None:
    """Ask a process to end, and kill it if it has not in time."""
    process.terminate()
    try:
        process.wait(timeout_s)
    except subprocess.TimeoutExpired:  # it hangs
        process.kill()
        process.wait()
