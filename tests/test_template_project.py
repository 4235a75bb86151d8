"""docs/template_project works as a copy of it, away from this repository."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from processes import ROOT, SMALL, call

from ibe_rl.storage.run_folder import CONFIG

FEW = [*SMALL[:-2], "log.capacity_frames=10000", "total_frames=2048", "refresh_every_frames=2048", "viewer=off"]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "docs" / "template_project", tmp_path / "mine"))


def test_its_own_test_passes(copy: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    ended = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=280)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "1 passed" in ended.stdout


def test_its_files_name_all_for_the_command_line(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(copy)
    try:
        call(
            "train", "--config-dir", "configs", *FEW, "env=corridor", "mapping=quiet", "listener=[diary]", "run_dir=run"
        )
        call("explain", "--config-dir", "configs", "run=run", "seed=3", "viewer=off")
    finally:
        sys.path.remove(str(copy))
    config = yaml.safe_load((copy / "run" / CONFIG).read_text())
    assert config["env"]["id"] == "my_project.environment:Corridor-v0"
    assert config["mapping"]["quiet"] == 0.1
    assert "2,048 frames" in (copy / "run" / "diary.txt").read_text()
