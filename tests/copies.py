"""Scripts as copies of one process, which has imported what all of them need; that takes seconds."""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import socket
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from runpy import run_module, run_path
from threading import Thread
from types import ModuleType
from typing import IO, Any

PRELOADED = ("ibe_rl.collect.collector", "ibe_rl.vocabulary.tracker", "ibe_rl.config.command_line", "ibe_rl.predict")
"""All of it without threads, which a copy would lack; importing rerun starts some."""


class Script:
    """A script that runs, as its starter sees it; has what the tests use of ``subprocess.Popen``.

    Attributes:
        pid: its process, which leads a process group of its own.
        stdout: what it prints, errors too.
        returncode: its exit status, negative for a signal, once that was asked for; None while it runs.
    """

    def __init__(self, arguments: tuple[str, ...], cwd: Path, environment: dict[str, str]):
        mine, theirs = socket.socketpair()
        read, write = os.pipe()
        with theirs:
            socket.send_fds(_copier(), [b"."], [theirs.fileno(), write])
        os.close(write)
        self.stdout: IO[str] = os.fdopen(read, encoding="utf-8", errors="replace")
        asked = {"arguments": arguments, "cwd": str(cwd), "environment": environment}
        mine.sendall(json.dumps(asked).encode() + b"\n")
        self._told = mine.makefile()
        self.pid, self.returncode = int(self._told.readline()), None

    def poll(self) -> int | None:
        if self.returncode is None and select.select([self._told], [], [], 0)[0]:
            self.returncode = int(self._told.readline())
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None and not select.select([self._told], [], [], timeout)[0]:
            raise subprocess.TimeoutExpired("a script", timeout or 0)
        return self.poll() or 0

    def communicate(self, timeout: float | None = None) -> tuple[str, None]:
        """The rest of what it prints, once it has ended and closed its output."""
        rest: list[str] = []
        reader = Thread(target=lambda: rest.append(self.stdout.read()), daemon=True)
        reader.start()
        reader.join(timeout)
        if reader.is_alive():
            raise subprocess.TimeoutExpired("a script", timeout or 0)
        self.wait(timeout)
        return rest[0], None

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


@cache
def _copier() -> socket.socket:
    """The way to the process that is copied; it ends with this one."""
    mine, theirs = socket.socketpair()
    with theirs:
        subprocess.Popen([sys.executable, __file__], stdin=theirs, start_new_session=True)
    return mine


def serve(requests: socket.socket) -> dict[str, Any]:
    """Make copies until nobody can ask any more; returns, in each copy, what it was asked for."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for those who wait for a script
    while True:
        _, descriptors, _, _ = socket.recv_fds(requests, 1, 2)
        if not descriptors:
            sys.exit()
        if os.fork() == 0:
            requests.close()
            return supervise(*descriptors)
        for each in descriptors:
            os.close(each)


def supervise(connection: int, output: int) -> dict[str, Any]:
    """Fork a script and tell how it ended; returns only in the script."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    asker = socket.socket(fileno=connection)
    asked = json.loads(asker.makefile().readline())
    script = os.fork()
    if script == 0:
        os.setsid()
        asker.sendall(f"{os.getpid()}\n".encode())
        asker.close()
        for descriptor, number in ((os.open(os.devnull, os.O_RDONLY), 0), (output, 1), (output, 2)):
            os.dup2(descriptor, number)
        os.close(output)
        return dict(asked)
    os.close(output)
    status = os.waitstatus_to_exitcode(os.waitpid(script, 0)[1])
    asker.sendall(f"{status}\n".encode())
    os._exit(0)


def run(arguments: list[str], cwd: str, environment: dict[str, str]) -> None:
    """Do what ``python ARGUMENTS`` does."""
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(environment)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", buffering=1, closefd=False) for number in (1, 2))
    first, *others = arguments
    if first == "-c":
        sys.path[0], sys.argv, main = "", ["-c", *others[1:]], ModuleType("__main__")
        sys.modules["__main__"] = main
        exec(others[0], main.__dict__)  # noqa: S102 - a test's own
    elif first == "-m":
        sys.path[0], sys.argv = cwd, others
        run_module(others[0], run_name="__main__", alter_sys=True)
    else:
        script = Path(first).absolute()
        sys.path[0], sys.argv = str(script.parent), arguments
        run_path(str(script), run_name="__main__")


if __name__ == "__main__":
    for name in PRELOADED:
        import_module(name)
    gc.freeze()  # copies share what is there
    this = sys.modules["__main__"]  # kept, so that nothing in it is cleared
    run(**serve(socket.socket(fileno=0)))
