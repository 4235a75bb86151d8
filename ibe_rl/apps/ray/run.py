"""Run a command on a Ray cluster as if it ran here: output, Ctrl-C and exit status are passed on.

python -m ibe_rl.apps.ray.run HOST:PORT PROCESSORS COMMAND...

For sweeps over several machines: the launcher puts this in front of the command of each run. The working directory
and the folders that the command writes to have to be the same on all machines (a shared disk).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ibe_rl.apps.ray.workers import connect
from ibe_rl.runtime.operating_system import killed_with_parent
from ibe_rl.runtime.signals import StopRequest, interrupts_stay_here
from ibe_rl.types import ConfigError

READ_S = 0.3


class Command:
    """A running command, in a process of Ray's.

    Args:
        command: to run.
        folder: its working directory.
    """

    def __init__(self, command: Sequence[str], folder: str):
        end_with_ray = killed_with_parent()

        def begin() -> None:
            end_with_ray()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # which Ray blocks in its processes

        self._written = tempfile.TemporaryFile()  # noqa: SIM115 - as long as this lives
        self._read = 0
        self._process = subprocess.Popen(  # noqa: S603 - what the caller would have run
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=self._written,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=begin,
        )

    def read(self, interrupt: bool) -> tuple[bytes, int | None]:
        """Wait a moment; returns the output since the last call, and the exit status once it has ended.

        Args:
            interrupt: send SIGINT first.
        """
        if interrupt:
            self._process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(READ_S)
        status = self._process.poll()
        text = os.pread(self._written.fileno(), 1 << 24, self._read)
        self._read += len(text)
        return text, status


def run_command(address: str, processors: int, command: Sequence[str]) -> int:
    """Run a command on the cluster; returns its exit status, negative for a signal as in ``subprocess``.

    Raises:
        ConfigError: if there is no such cluster.
    """
    import ray

    with interrupts_stay_here():
        connect(address, key="HOST:PORT")
        actor = ray.remote(num_cpus=processors, max_restarts=0)(Command).remote(list(command), str(Path.cwd()))
    with StopRequest() as stop:
        asked = False
        while True:
            tell = bool(stop) and not asked  # Ctrl-C may come during the wait
            text, status = ray.get(actor.read.remote(tell))
            asked = asked or tell
            sys.stdout.buffer.write(text)
            sys.stdout.flush()
            if status is not None:
                return int(status)


def main(arguments: Sequence[str]) -> int:
    """Run the command elsewhere, with its output and exit status here."""
    address, processors, *command = arguments
    try:
        status = run_command(address, int(processors), command)
    except ConfigError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    except Exception as error:  # Ray's, when the machine is lost
        first: Any = str(error).strip().splitlines() or [type(error).__name__]
        sys.stderr.write(f"error: the machine that it ran on, or Ray there, is gone ({first[0]})\n")
        return 1
    return status if status >= 0 else 128 - status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
