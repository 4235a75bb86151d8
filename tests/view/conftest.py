"""Recordings that several files look into."""

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
