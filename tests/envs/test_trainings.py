"""Each environment that comes with the project, trained for a few thousand frames from its file in configs/env."""

import csv
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.evaluation.narration import explainer_state
from ibe_rl.evaluation.runs import load_run
from ibe_rl.explain.explainer import explain
from ibe_rl.ibe import phrases_of
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.log import TrajectoryLog

FEW = ["viewer=file", "eval_episodes=3", "explain_every_steps=50", "predictor.futures=1", "mapping.spans_steps=[]"]
ACTIONS = {"lander_continuous": (2,), "reacher": (2,)}
"""The shape of one action where it is not one number."""
SLOW_ENGINES = {"car_racing", "highway"}
"""Their own tests train them for a few hundred frames."""
FILES = sorted({path.stem for path in (Path(__file__).parents[2] / "configs" / "env").glob("*.yaml")} - SLOW_ENGINES)


@pytest.mark.parametrize("name", FILES)
def test_it_trains_learns_a_vocabulary_and_explains(name: str, tmp_path: Path):
    folder = tmp_path / name
    once = [*("total_frames=4000", "refresh_every_frames=4000", "eval_every_frames=4000"), "first_refresh_episodes=0"]
    call("train", f"env={name}", *SMALL, *FEW, *once, f"run_dir={folder}")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["frames"], summary["refreshes"], summary["refreshes_skipped"]) == (4096, 1, 0)
    with (folder / "metrics.csv").open() as stream:
        assert all(np.isfinite(float(row["train/entropy"])) for row in csv.DictReader(stream))
    assert (folder / "recording.rrd").stat().st_size > 10_000

    run = load_run(folder)
    game, shape = run.make_env(), ACTIONS.get(name, ())
    logged = TrajectoryLog.open(folder / "trajectories").read([0])[0]
    assert logged.actions.shape == (len(logged), *shape)
    assert all(game.action_space.contains(action) for action in logged.actions)
    instructor = make_instructor(InstructorConfig(), run.task)
    flight = record_rollout(game, run.policy, instructor, seed=1)
    assert all(game.action_space.contains(action) for action in flight.episode.actions)
    simulator = Simulator(partial(make_snapshot_env, run.config.env), run.task.rule)
    said = explain(flight.moments[:3], run.policy, simulator, explainer_state(run))
    assert {one.phrase for one in said} <= set(phrases_of(run.mapping.expressions, run.task.phrases))
