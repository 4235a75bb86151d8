"""What a run asks of its schedules."""

from types import SimpleNamespace
from typing import Any

import pytest

from ibe_rl.config.settings import TrainConfig
from ibe_rl.training.run import Counts, Run


@pytest.mark.parametrize(
    ("counts", "due"),
    [(Counts(), True), (Counts(refreshes=1), False), (Counts(kept=1), False), (Counts(skipped=1), False)],
)
def test_a_run_that_is_resumed_has_no_second_early_refresh(counts: Counts, due: bool) -> None:
    config = TrainConfig(refresh_every_frames=1000, first_refresh_episodes=5)
    run: Any = SimpleNamespace(cfg=config, log=SimpleNamespace(frames=50, episodes_ended=4), counts=counts)
    Run.schedule(run)
    assert not Run.refresh_due(run, 55, last=False)
    run.log.episodes_ended = 6
    assert Run.refresh_due(run, 60, last=False) is due
