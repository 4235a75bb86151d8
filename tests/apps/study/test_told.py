"""Episodes that go on otherwise: the same until the last frame that is seen, then told something else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lifts import HORIZON, LIFT, ride, speaker
from processes import ROOT

from ibe_rl.apps.study import stimuli
from ibe_rl.apps.study.episode_file import read_episode
from ibe_rl.apps.study.make import make
from ibe_rl.apps.study.stimuli import CutEpisode, told_otherwise
from ibe_rl.apps.study.told import ToldFrom
from ibe_rl.instructors.silent import Silent
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Moment, Policy, Prediction, columns_of

FRAMES = 4


def test_somebody_else_speaks_until_the_step() -> None:
    instructor = ToldFrom(Silent(1), 2, np.ones(1, np.float32))
    for _ in range(2):  # episodes
        instructor.reset(np.ones(1, bool))
        said = [instructor.instruct(np.zeros((1, 3)), np.ones(1, bool)) for _ in range(4)]
        assert [float(instruction[0, 0]) for instruction, _ in said] == [0, 0, 1, 1]
        assert [float(given[0, 0]) for _, given in said] == [0, 0, 1, 1]


class Obeys:
    """Foresees a metre a step in the direction that it is told."""

    def rollout(self, moments: list[Moment], policy: Policy, horizon_steps: int) -> Prediction:
        states, instruction, _ = columns_of(moments)
        steps = np.arange(horizon_steps + 1.0)[None, :, None]
        return Prediction.exact((states[:, None] + steps * instruction[:, None]).astype(np.float32))


def test_what_it_would_do_is_said_and_not_what_it_will() -> None:
    agent = speaker()
    vars(agent.run)["what_if_calibration"] = None
    obeys, moments = replace(agent, predictor=Obeys()), [Moment(np.zeros(1), np.ones(1), True)] * 3
    will, would = obeys.say(moments)["ibe"], obeys.say(moments, "going down")["ibe"]
    assert (will.expressions, would.expressions) == ((1.0,) * 3, (-1.0,) * 3)
    assert would.phrases == ("going down",) * 3


def cut(seed: int, watched: RecordedRollout) -> CutEpisode:
    return CutEpisode(seed, watched, last=6, end=6 + HORIZON, frames=FRAMES)


def test_it_is_told_another_value_than_before_and_flown_again(monkeypatch: pytest.MonkeyPatch) -> None:
    again: list[tuple[int, float]] = []

    def fly(_: Any, __: Policy, instructor: ToldFrom, seed: int) -> RecordedRollout:
        instructor.reset(np.ones(1, bool))
        told = [float(instructor.instruct(np.zeros((1, 1)), np.ones(1, bool))[0][0, 0]) for _ in range(8)]
        assert told[:6] == [0] * 6
        again.append((seed, told[6]))
        return ride(range(12))

    monkeypatch.setattr(stimuli, "record_rollout", fly)
    before = [cut(seed, ride(np.zeros(20))) for seed in range(40)]
    found = [*told_otherwise(iter(before), Any, LIFT, lambda _: np.zeros(1), Silent(1))]
    assert [one.seed for one in found] == [*range(40)]
    assert {value for _, value in again} == {-1.0, 1.0}  # it was told 0
    names = {-1.0: "going down", 1.0: "going up"}
    assert [one.told for one in found] == [names[value] for _, value in again]
    assert [one.told for one in told_otherwise(iter(before), Any, LIFT, lambda _: np.zeros(1), Silent(1))] == [
        one.told for one in found
    ]
    assert all(one.states[-1, 0] == 11 for one in found)


def test_what_then_ends_too_soon_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stimuli, "record_rollout", lambda *_: ride(range(6 + HORIZON)))
    assert not [*told_otherwise(iter([cut(1, ride(np.zeros(20)))]), Any, LIFT, lambda _: np.zeros(1), Silent(1))]


def test_a_study_of_the_demo_asks_what_if(tmp_path: Path) -> None:
    few = {"trials.practice": 0, "trials.each_arm": 2, "trials.attention_checks": 0, "trials.task": "what_if"}
    made = make(str(ROOT / "demo"), str(tmp_path / "study"), seed=3, flights=10, scales=[], **few)
    assert json.loads((made / "made.json").read_text())["until"] == "lot"
    for path in sorted((made / "stimuli").glob("*.json")):
        one = read_episode(path.read_text(), "what_if", str(path))
        assert one["told"].startswith("falling")
        assert one["phrases"][one["truth"]["choice"]] == one["explanations"]["true_future"]["phrases"][-1]
    assert "“{told}”" in (made / "texts/en/words.yaml").read_text()
