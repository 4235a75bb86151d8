"""The server of a study in a process of its own, which can be killed, and what waits in its pages."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Error, Page

from ibe_rl.apps.study.answers import FILE, Answer, Answers
from ibe_rl.runtime.ports import free_port

SERVE = (
    "import sys; from pathlib import Path; from ibe_rl.apps.study.serving import serve; "
    "serve(Path(sys.argv[1]), port=int(sys.argv[2]), admin_port=int(sys.argv[3]))"
)


@dataclass
class Served:
    """A study that is served."""

    folder: Path
    port: int = field(default_factory=lambda: free_port(0, 0))
    admin_port: int = field(default_factory=lambda: free_port(0, 0))
    process: subprocess.Popen[str] | None = None

    def start(self) -> list[str]:
        """Start the server; returns what it said once it answers."""
        command = [sys.executable, "-c", SERVE, str(self.folder), str(self.port), str(self.admin_port)]
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
        )
        assert self.process.stdout is not None
        said: list[str] = []
        while not (said and "take part here" in said[-1]):
            line = self.process.stdout.readline()
            assert line, said
            said.append(line.strip())
        return said

    def end(self, how: signal.Signals) -> int:
        """End it with a signal; returns its exit status."""
        assert self.process is not None
        self.process.send_signal(how)
        self.process.communicate(timeout=240)
        return self.process.returncode

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def kept(self) -> dict[int, list[Answer]]:
        """The answers of everybody, by the number of the person."""
        answers = Answers(self.folder / FILE)
        try:
            return {one.number: answers.answers_of(one) for one in answers.people(pilots=True)}
        finally:
            answers.close()


@contextmanager
def served(folder: Path) -> Iterator[Served]:
    """Serve a study until the context is left."""
    server = Served(folder)
    try:
        server.start()
        yield server
    finally:
        if server.process is not None and server.process.poll() is None:
            server.process.kill()
            server.process.wait()


def wait_until(page: Page, condition: str, seconds: float = 60.0) -> Any:
    """Wait until something is true in the page; returns what it is."""
    end = time.monotonic() + seconds
    while True:  # playwright's own waiting needs what the page forbids
        with suppress(Error):  # another page is loading
            if found := page.evaluate(condition):
                return found
        assert time.monotonic() < end, f"not in {seconds} s: {condition}\n{page.inner_text('body')}"
        time.sleep(0.02)
