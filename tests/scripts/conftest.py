"""The small run that the tests of the scripts share."""

from __future__ import annotations

from pathlib import Path

import pytest
from processes import SMALL_RUN, call


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "small"
    call("train", *SMALL_RUN, f"run_dir={folder}", "viewer=file")
    return folder
