"""A small real run, to be damaged or to be made a trap of."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from processes import SMALL, call

OVERRIDES = [*SMALL, "total_frames=4000", "eval_every_frames=2000", "mapping.spans_steps=[10]", "viewer=file"]


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Never changed."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    call("train", *OVERRIDES, f"run_dir={folder}")
    return folder


@pytest.fixture
def run(trained: Path, tmp_path: Path) -> Path:
    """A copy to be damaged."""
    return Path(shutil.copytree(trained, tmp_path / "run"))
