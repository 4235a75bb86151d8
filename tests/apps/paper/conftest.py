"""A small run that the paper's experiments can be done with."""

import shutil
from pathlib import Path

import pytest
from processes import ROOT, SMALL, call


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run with two policies that hardly learnt anything and two that can land: the demo's."""
    folder = tmp_path_factory.mktemp("trained") / "run"
    small = [setting for setting in SMALL if not setting.startswith("agent.hidden")]  # the demo's network
    call("train", *small, f"run_dir={folder}", "viewer=off")
    [skilled] = (ROOT / "demo" / "checkpoints").glob("policy_*.pt")
    for name in ("between_000000004608.pt", "policy_000000009216.pt"):
        shutil.copy(skilled, folder / "checkpoints" / name)
    return folder
