"""An empty log of the lift, and settings under which only what is newest counts."""

from pathlib import Path

import pytest
from by_hand import STEPS, TASK, config

from ibe_rl.ibe import IBEConfig
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.vocabulary import tracker as module


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return TrajectoryLog(tmp_path / "log", 10_000, TASK.contexts)


@pytest.fixture
def only_the_newest_count(monkeypatch: pytest.MonkeyPatch) -> IBEConfig:
    """Vocabularies are learnt from, and scored on, the last three episodes, without any memory."""
    monkeypatch.setattr(module, "SCORED_EPISODES", 3)
    return config(newest_frames=3 * STEPS, memory=None)
