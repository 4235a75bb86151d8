"""The server's process as the relay sees it, with small processes in its place."""

import os
import signal
import sys
from collections.abc import Iterator

import pytest
from processes import process_state
from view_data import eventually

from ibe_rl.view import server as module
from ibe_rl.view.server import ViewerServer

READS = "import sys; sys.stdin.buffer.read(); sys.exit(3)"


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    made = ViewerServer([sys.executable, "-c", READS])
    yield made
    made.stop()


def test_one_that_reads_does_not_hang(server: ViewerServer, monkeypatch: pytest.MonkeyPatch) -> None:
    assert server.feed(b"some") == b""
    assert not server.hangs()
    monkeypatch.setattr(module, "HANG_S", 0.0)
    assert eventually(lambda: not server.hangs())  # all is taken


def test_one_that_leaves_a_little_in_the_pipe_hangs_and_may_recover(
    server: ViewerServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert eventually(lambda: server.feed(b"it runs") == b"" and not _waits(server))
    monkeypatch.setattr(module, "HANG_S", 0.2)
    os.kill(server._process.pid, signal.SIGSTOP)
    assert eventually(lambda: process_state(server._process.pid) == "T")  # until then it may still take what comes
    server.feed(b"some")
    assert not server.hangs()
    assert eventually(server.hangs)
    os.kill(server._process.pid, signal.SIGCONT)
    assert eventually(lambda: not server.hangs())


def _waits(server: ViewerServer) -> bool:
    server.hangs()
    return server._given > server._taken


def test_how_it_ended_is_known(server: ViewerServer) -> None:
    os.close(server._pipe)
    assert eventually(lambda: not server.alive())
    assert server.ending() == "exit status 3"


def test_one_that_has_died_takes_nothing(server: ViewerServer) -> None:
    os.kill(server._process.pid, signal.SIGKILL)
    assert eventually(lambda: not server.alive())
    assert server.feed(b"some") == b"some"
    assert server.ending() == "SIGKILL"
