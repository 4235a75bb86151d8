"""Explanations as they are spoken: held against what came true, step by step, in the demo run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ibe_rl.collect.rollout import play
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.run_predictor import predictor_of
from ibe_rl.evaluation.runs import load_run
from ibe_rl.evaluation.step_by_step import judge_spoken
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.instructors import make_instructor
from ibe_rl.metrics.quality import realised_phrases
from ibe_rl.metrics.stability import stability

pytestmark = pytest.mark.slow

SEEDS, HELD_OUT = range(900_000, 900_003), range(910_000, 910_002)


@pytest.fixture(scope="module")
def run() -> TrainedRun:
    return load_run(Path(__file__).parents[2] / "demo")


@pytest.fixture(scope="module")
def cfg() -> ExplainConfig:
    settings: ExplainConfig = composed("explain", ["run=demo", "predictor.processes=1", "evaluate.resamples=20"])
    return settings


def test_what_is_spoken_holds_still_and_comes_true(run: TrainedRun, cfg: ExplainConfig):
    with predictor_of(run, cfg.predictor, seed=0) as predictor:
        report, calibration = judge_spoken(run, cfg, predictor, SEEDS, HELD_OUT)
        assert judge_spoken(run, cfg, predictor, range(0), HELD_OUT) == ({}, None)
    assert calibration is not None
    probability = calibration.probability(np.array([[0.4, 0.8], [1.0, 0.8]]))
    assert probability[0] < probability[1]
    rows = {row["explainer"]: row for row in report["rows"]}
    assert [*rows] == ["spoken", "moment", "real"]
    episodes = play([run.make_env()], run.policy, make_instructor(run.config.instructor, run.task), SEEDS)
    assert (report["episodes"], report["steps"]) == (len(SEEDS), sum(map(len, episodes)))
    real = [realised_phrases(one, run.horizon_steps, run.mapping, run.task.phrases) for one in episodes]
    changes = [stability(phrases)["phrase_changes_per_100"] for phrases in real]
    mean = np.average(changes, weights=[len(one) for one in episodes])
    assert rows["real"]["phrase_changes_per_100"]["value"] == pytest.approx(mean, abs=1e-4)
    assert rows["real"]["came_true"]["value"] == 1
    assert rows["real"]["lag_steps"] == 0
    spoken, alone = rows["spoken"], rows["moment"]
    assert spoken["phrase_changes_per_100"]["value"] < alone["phrase_changes_per_100"]["value"]
    assert spoken["came_true"]["value"] > 0.6
    assert 0 <= spoken["ece"]["value"] <= 1
    assert spoken["lasting_changes"] == alone["lasting_changes"] == rows["real"]["lasting_changes"] > 0


def test_the_same_seeds_give_the_same_numbers(run: TrainedRun, cfg: ExplainConfig):
    few, each = replace(cfg, predictor=replace(cfg.predictor, futures=2)), []
    for _ in range(2):
        with predictor_of(run, few.predictor, seed=0) as predictor:
            each.append(judge_spoken(run, few, predictor, SEEDS[:1], HELD_OUT[:1])[0])
    assert each[0] == each[1]
