"""A run whose environment fails late ends in one line, with its log, its state and a summary."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import pytest
from awkward import STEPS, Lift, behind_gate
from processes import SMALL, call

from ibe_rl.envs.errors import GateError
from ibe_rl.storage.checkpoint import LATEST
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import CHECKPOINTS, SUMMARY, TRAJECTORIES
from ibe_rl.training.failure import resumable
from ibe_rl.training.success_note import SuccessNote


class BreaksLate(Lift):
    steps_of_all = 0

    def step(self, action: Any) -> Any:
        BreaksLate.steps_of_all += 1
        if BreaksLate.steps_of_all > 1500:
            raise RuntimeError("the cable broke")
        return super().step(action)


gymnasium.register("tests/BreaksLate-v0", BreaksLate, max_episode_steps=STEPS)
CONFIG = """
defaults: [schema]
id: test_failure:tests/BreaksLate-v0
task:
  name: Lift
  rule: awkward:up_or_down
  success_key: arrived
  state_names: [height, speed]
  explained: [height]
  explained_band: [0.05]
  phrases: [{zero: staying, negative: "going {degree}down", positive: "going {degree}up"}]
"""


def test_it_ends_in_order(tmp_path: Path):
    (tmp_path / "cfg" / "env").mkdir(parents=True)
    (tmp_path / "cfg" / "env" / "lift.yaml").write_text(CONFIG)
    run = tmp_path / "run"
    wanted = ["env=lift", f"run_dir={run}", "viewer=off", "mapping.spans_steps=[]", "mapping.horizon_steps=5"]
    with pytest.raises(SystemExit) as ended:
        call("train", "--config-dir", str(tmp_path / "cfg"), *SMALL, *wanted)
    line = str(ended.value.code)
    assert line.startswith("error: env.id=test_failure:tests/BreaksLate-v0, episode of seed ")
    assert "its step() raised RuntimeError: the cable broke (" in line
    assert line.endswith(f"resume={run}")
    assert len(line.splitlines()) == 1
    summary = json.loads((run / SUMMARY).read_text())
    assert summary["failure"] in line
    assert (summary["frames"], summary["stopped_early"], summary["success_rate"]) == (1024, True, None)
    assert TrajectoryLog.open(run / TRAJECTORIES).frames == 1024
    assert (run / CHECKPOINTS / LATEST).is_file()


def test_a_failure_before_the_first_frame_leaves_no_state(tmp_path: Path):
    run = SimpleNamespace(folder=tmp_path, log=SimpleNamespace(frames=0))
    with pytest.raises(GateError, match=r"^it failed$"), resumable(run):
        raise GateError("it failed")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("key", "told"), [("arrived", 1), ("other", 0)])
def test_a_key_of_success_that_never_comes_is_noted_once(key: str, told: int):
    env = behind_gate(lambda _, given: (*given[:4], {"other": True}), success_key=key)
    run = SimpleNamespace(evaluation_envs=[env], task=SimpleNamespace(success_key=key), notes=[])
    listener = SuccessNote()
    listener.begin(run)
    assert not list(listener.news())
    env.reset(seed=0)
    env.step(1)
    for expected in (told, 0):
        listener.evaluated(10, 0.0, 0.0)
        assert len(list(listener.news())) == expected
    assert len(run.notes) == told


def test_the_nearest_key_is_named():
    env = behind_gate(lambda _, given: (*given[:4], {"arived": True}))
    run = SimpleNamespace(evaluation_envs=[env], task=SimpleNamespace(success_key="arrived"), notes=[])
    listener = SuccessNote()
    listener.begin(run)
    env.reset(seed=0)
    env.step(1)
    listener.evaluated(10, 0.0, 0.0)
    [note] = listener.news()
    assert note == (
        "note: no info of the evaluation had the success key 'arrived', so no episode succeeds; "
        "its keys were arived; did you mean arived?"
    )
