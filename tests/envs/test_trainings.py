"""Each environment that comes with the project, trained for a few thousand frames from its file in configs/env."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.evaluation.run_predictor import predictor_of
from ibe_rl.evaluation.runs import load_run
from ibe_rl.evaluation.trained_run import explainer_state
from ibe_rl.explain.explainer import explain
from ibe_rl.ibe import phrases_of
from ibe_rl.instructors import make_instructor
from ibe_rl.storage.log import TrajectoryLog

FEW = ["viewer=file", "eval_episodes=3", "explain_every_steps=50", "predictor.futures=1", "mapping.spans_steps=[]"]
TWO, FOUR = ["lander_continuous", "reacher"], ["fetch_reach", "bipedal_walker"]
ACTIONS = {"pendulum": (1,), **dict.fromkeys(TWO, (2,)), **dict.fromkeys(FOUR, (4,))}
"""The shape of one action where it is not one number."""
LEARNT = {"bipedal_walker": ["predictor.updates=5"]}
"""Settings of those whose predictor is learnt."""
ELSEWHERE = {"mountain_car", "car_racing", "highway"}
"""Those with a test of their own: a beginner on the hill hears one thing only, two engines are slow."""
FILES = sorted({path.stem for path in (Path(__file__).parents[2] / "configs" / "env").glob("*.yaml")} - ELSEWHERE)


@pytest.mark.parametrize("name", FILES)
def test_it_trains_learns_a_vocabulary_and_explains(name: str, tmp_path: Path):
    folder = tmp_path / name
    once = [*("total_frames=4000", "refresh_every_frames=4000", "eval_every_frames=4000"), "first_refresh_episodes=0"]
    call("train", f"env={name}", *SMALL, *FEW, *once, *LEARNT.get(name, []), f"run_dir={folder}")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["frames"], summary["refreshes"], summary["refreshes_skipped"]) == (4096, 1, 0)
    with (folder / "metrics.csv").open() as stream:
        learnt = [row["train/entropy"] for row in csv.DictReader(stream)]
    assert all(np.isfinite(float(entropy)) for entropy in learnt[1:])  # the first batch may only be measured
    assert (folder / "recording.rrd").stat().st_size > 10_000

    run = load_run(folder)
    game, shape = run.make_env(), ACTIONS.get(name, ())
    logged = TrajectoryLog.open(folder / "trajectories").read([0])[0]
    assert logged.actions.shape == (len(logged), *shape)
    assert all(game.action_space.contains(action) for action in logged.actions)
    instructor = make_instructor(InstructorConfig(), run.task)
    flight = record_rollout(game, run.policy, instructor, seed=1)
    assert all(game.action_space.contains(action) for action in flight.episode.actions)
    with predictor_of(run, run.config.predictor, seed=0) as predictor:
        said = explain(flight.moments[:3], run.policy, predictor, explainer_state(run))
    assert {one.phrase for one in said} <= set(phrases_of(run.mapping.expressions, run.task.phrases))
