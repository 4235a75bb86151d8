"""Flying in other processes gives what flying here gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from processes import ROOT

from ibe_rl.apps.paper.report_context import EpisodeRunner, shared_between
from ibe_rl.config.settings import EnvConfig, InstructorConfig
from ibe_rl.evaluation.runs import load_run

pytestmark = pytest.mark.slow

SEEDS = [range(5), range(7, 9), range(20, 23)]


def test_flights_are_the_same_in_one_process_and_in_two() -> None:
    policy, env = load_run(Path(ROOT / "demo")).policy, EnvConfig("ibe_rl/LunarLanderPads-v0")
    together = []
    for processes in (1, 2):
        with shared_between(EpisodeRunner(env, InstructorConfig()), processes) as run_all:
            together.append(list(run_all([policy] * 3, SEEDS)))
    assert [len(episodes) for episodes in together[0]] == [5, 2, 3]
    for here, there in zip(*together, strict=True):
        for one, other in zip(here, there, strict=True):
            np.testing.assert_array_equal(one.states, other.states)
            np.testing.assert_array_equal(one.instructions, other.instructions)
