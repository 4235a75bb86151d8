"""Each environment that comes with the project, trained for a few thousand frames from its file in configs/env."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.config import InstructorConfig
from ibe_rl.evaluation import load_run
from ibe_rl.instruct import make_instructor
from ibe_rl.log import TrajectoryLog
from ibe_rl.play import play

ONCE = ["total_frames=4000", "refresh_every_frames=4000", "eval_every_frames=4000", "viewer=file"]
FEW = ["eval_episodes=3", "explain_every_steps=50", "predictor.futures=1", "mapping.spans_steps=[]"]
FILES = sorted(path.stem for path in (Path(__file__).parents[2] / "configs" / "env").glob("*.yaml"))
NEEDS = {"reacher": "mujoco"}


@pytest.mark.parametrize("name", FILES)
def test_it_trains_and_explains_and_its_policy_acts_within_bounds(name: str, tmp_path: Path):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    folder = tmp_path / name
    call("train", f"env={name}", *SMALL, *FEW, *ONCE, f"run_dir={folder}")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["frames"], summary["refreshes"], summary["refreshes_skipped"]) == (4096, 1, 0)
    with (folder / "metrics.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert all(np.isfinite(float(row["train/entropy"])) for row in rows)
    assert 0 <= float(rows[-1]["ibe/came_true"]) <= 1
    assert (folder / "recording.rrd").stat().st_size > 10_000

    run = load_run(folder)
    game = run.make_env()
    logged = TrajectoryLog.open(folder / "trajectories").read([0])[0]
    flown = play([game], run.policy, make_instructor(InstructorConfig(), run.task), [1])[0]
    for episode in (logged, flown):
        assert episode.actions.shape == (len(episode), *(game.action_space.shape or ()))
        assert all(game.action_space.contains(action) for action in episode.actions)
