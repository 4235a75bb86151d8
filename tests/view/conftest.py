"""Recordings that several files look into, and a port that somebody listens on."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from view_data import TASK, Rows, read, record

from ibe_rl.view.recorder import Recorder


@pytest.fixture(scope="session")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    """A whole small run, written and read back."""
    path = tmp_path_factory.mktemp("recorded") / "recording.rrd"
    record(path)
    return read(path)


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    """Writes to ``recording.rrd`` in the folder of the test."""
    return Recorder(tmp_path / "recording.rrd", TASK, "run")


@pytest.fixture
def taken() -> Iterator[int]:
    """A port of this machine on which another program listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]
