"""Two agents side by side: which one is better stands on neither side more often."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from lifts import DRAWN, HORIZON, ride, speaker

from ibe_rl.apps.study import sides
from ibe_rl.apps.study.episode_file import read_episode
from ibe_rl.apps.study.scenes import scene_of
from ibe_rl.apps.study.sides import MOST_FRAMES, pairs_of, record_side

SCENE = scene_of(DRAWN, [], 24)


class Stage:
    """An environment that is only made and closed."""

    def close(self) -> None:
        """Nothing to do."""


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Any]:
    """One agent climbs as it says, the other stays."""
    better, other = speaker(task=DRAWN), speaker(task=DRAWN)
    for one, pace in ((better, 1.0), (other, 0.0)):
        one.run.policy = pace  # type: ignore[misc]
        one.run.make_env = Stage  # type: ignore[misc]
    monkeypatch.setattr(sides, "instructor_of", lambda _: None)
    monkeypatch.setattr(sides, "record_rollout", lambda _, pace, *__: ride(pace * np.arange(15)))
    return better, other


def test_a_recording_ends_a_horizon_before_the_episode(two: tuple[Any, Any]) -> None:
    one = record_side(two[0], 1)
    assert one.steps == range(14 - HORIZON)
    assert one.reward == 10.0
    assert one.hits == {"ibe": 1.0, "paper": 1.0, "true_future": 1.0}
    assert record_side(two[1], 1).hits["ibe"] == 0.0
    assert len(one.said["ibe"].phrases) == 10


def test_a_long_recording_skips_steps_and_keeps_the_pace(two: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sides, "record_rollout", lambda *_: ride(np.arange(405)))
    assert record_side(two[0], 1).steps == range(0, 400, 3)
    [pair] = pairs_of(*two, SCENE, [1], 20.0, np.random.default_rng(0))
    assert [(side["frame_ms"], len(side["frames"])) for side in pair["sides"]] == [(60.0, 134)] * 2
    assert MOST_FRAMES == 150


def test_pairs_are_as_often_the_one_way_as_the_other(two: tuple[Any, Any]) -> None:
    pairs = pairs_of(*two, SCENE, range(8), 20.0, np.random.default_rng(0))
    truths = [pair["truth"]["choice"] for pair in pairs]
    assert sum(truths) == 4
    for pair in pairs:
        better = pair["sides"][pair["truth"]["choice"]]
        assert better["frames"][-1][0]["points"][-1] == [9.0, 9.0]
        assert pair["observers"]["ibe"]["choice"] == pair["truth"]["choice"]
        assert pair["observers"]["placebic"] == pair["observers"]["none"]
        assert {*better["explanations"]} == {"ibe", "paper", "placebic", "true_future"}
        assert read_episode(json.dumps(pair), "which_agent", "one.json")["frames"] == []


def test_the_papers_arm_is_there_only_if_both_have_it(two: tuple[Any, Any]) -> None:
    other = speaker(paper=None, task=DRAWN)
    other.run.policy, other.run.make_env = 0.0, Stage  # type: ignore[misc]
    [pair] = pairs_of(two[0], other, SCENE, [1], 20.0, np.random.default_rng(0))
    assert "paper" not in pair["sides"][0]["explanations"]
