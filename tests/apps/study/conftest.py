"""Studies that are made once for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from processes import ROOT

from ibe_rl.apps.study.make import make

FEW = {"flights": 40, "trials.practice": 1, "trials.each_arm": 4, "trials.attention_checks": 1}


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of the demo's agent in all arms."""
    folder = tmp_path_factory.mktemp("made") / "study"
    arms = {"arms": ["none", "paper", "ibe", "placebic", "true_future"]}
    return make(str(ROOT / "demo"), str(folder), seed=3, contact="lab@example.org", **FEW, **arms)
