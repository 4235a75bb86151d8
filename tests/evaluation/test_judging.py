"""Everybody judged on the same moments, with answers known beforehand."""

from typing import Any

import numpy as np
import pytest
from lift import TASK, moments, words

from ibe_rl.evaluation.baselines import StateRegressor
from ibe_rl.evaluation.judging import GOALS, Learnt, confidence_of, judge, paired_of, rows_of
from ibe_rl.evaluation.moments import Moments
from ibe_rl.evaluation.rows import ROW_METRICS, Judged
from ibe_rl.metrics.bootstrap import episode_weights
from ibe_rl.types import Array

OURS = "ibe:lift"
EPISODES = 12


class Nothing:
    """A regression that foretells no movement at all."""

    def predict(self, states: Array) -> Array:
        return np.zeros(len(states))


def flights(seed: int) -> Moments:
    """Half of the moments up, half down; told at random; foreseen in the first of three futures, or in all of them.

    The mean over the futures has the right direction everywhere, most of the futures only somewhere.
    """
    random = np.random.default_rng(seed)
    change = random.permutation(np.repeat([-3.0, -1.5, 0, 1.5, 3], EPISODES))
    other = np.where(random.permutation(len(change)) % 2, change, 0)
    futures = np.column_stack([change, other, other])
    found = random.integers(-1, 2, len(change))
    return moments(change, futures, found, np.repeat(np.arange(EPISODES), 5), speed=-change)


@pytest.fixture(scope="module")
def judged() -> Judged:
    wrong = words(expressions=(1, 0, -1))
    learnt = Learnt(
        {OURS: words(), "baseline:paper": words((-4, 0, 2), (-1, 0, 1))},
        {"baseline:shuffled": [words(), wrong], "baseline:random_clusters": [wrong]},
        [StateRegressor("ridge", Nothing(), {})],
    )
    here = flights(0)
    return judge(learnt, here, flights(1), 5, TASK, episode_weights(here.episode, 100, 0), seed=0)


def values(judged: Judged, name: str, metric: str) -> Any:
    [row] = [row for row in rows_of(judged) if row["explainer"] == name]
    return row[metric] and row[metric]["value"]


NAMES = ("present_velocity", "direction_to_goal", "last_instruction", "constant", "state_regressor", "paper", "flipped")
NAMES += ("predicted_change", "true_future", "another_moment", "shuffled", "random_clusters")


def test_every_explainer_has_a_row_with_every_metric(judged: Judged):
    rows = rows_of(judged)
    assert rows[0]["explainer"] == OURS
    assert {row["explainer"] for row in rows[1:]} == {f"baseline:{name}" for name in NAMES}
    assert len(rows) == 1 + len(NAMES)
    for row in rows:
        assert row["horizon_steps"] == 5
        assert set(ROW_METRICS) <= set(row)
        for metric in ROW_METRICS:
            assert row[metric] is None or set(row[metric]) == {"value", "low", "high"}, (row["explainer"], metric)


def test_who_is_right_and_who_is_wrong(judged: Judged):
    for name in (OURS, "baseline:predicted_change", "baseline:true_future"):
        assert values(judged, name, "motion_auc") == 1
    for name in ("baseline:flipped", "baseline:present_velocity"):  # here speed is against the movement
        assert values(judged, name, "motion_auc") == 0
    assert values(judged, "baseline:constant", "motion_auc") == 0.5
    assert values(judged, "baseline:constant", "motion_spearman") is None
    assert values(judged, "baseline:flipped", "motion_spearman") == -values(judged, OURS, "motion_spearman") < -0.8
    assert 0.2 < values(judged, "baseline:another_moment", "motion_auc") < 0.8
    assert values(judged, "baseline:last_instruction", "instruction_f1") == 1
    assert values(judged, "baseline:paper", "motion_auc") < 1  # calls small movements down nothing


def test_what_the_vocabulary_loses_is_of_the_words_alone_against_the_predicted_change(judged: Judged):
    assert 0.5 < values(judged, OURS, "motion_auc_words") < 1  # most futures say that nothing moves
    for name in (OURS, "baseline:flipped", "baseline:paper"):
        expected = 1 - values(judged, name, "motion_auc_words")
        assert values(judged, name, "vocabulary_loss") == pytest.approx(expected, abs=1e-5)
    assert values(judged, "baseline:present_velocity", "motion_auc_words") is None
    assert values(judged, "baseline:present_velocity", "vocabulary_loss") is None


def test_what_makes_no_sense_is_null(judged: Judged):
    assert values(judged, OURS, "came_true") == 1
    assert values(judged, OURS, "came_true_voted") < 1
    assert values(judged, OURS, "brier") < 0.1
    assert values(judged, OURS, "left_right") == [1, 1]
    for metric in ("came_true", "brier", "size_cv", "observer_error"):
        assert values(judged, "baseline:state_regressor", metric) is None
    assert values(judged, "baseline:flipped", "brier") is None


def test_refits_are_reported_with_their_distribution(judged: Judged):
    [row] = [row for row in rows_of(judged) if row["explainer"] == "baseline:shuffled"]
    assert row["over"] == "refits"
    assert row["refits"]["motion_auc"] == [1, 0]
    assert row["motion_auc"] == {"value": 0.5, "low": 0.025, "high": 0.975}
    assert row["refits"]["vocabulary_loss"] == [0, 1]


def test_the_best_cheap_baseline_is_named(judged: Judged):
    paired = paired_of(judged, OURS)
    assert {(each["metric"], each["minus"]) for each in paired} == {
        (metric, f"baseline:{name}") for metric in GOALS for name in (*NAMES[:5], "paper")
    }
    best = {each["metric"]: each for each in paired if each["best_cheap"]}
    assert set(best) == set(GOALS)
    auc = {name: values(judged, f"baseline:{name}", "motion_auc") for name in NAMES[:5]}
    assert best["motion_auc"]["minus"] == f"baseline:{max(auc, key=lambda name: auc[name])}"
    assert best["motion_auc"]["difference"]["value"] == pytest.approx(1 - max(auc.values()), abs=1e-5)
    velocity = next(each for each in paired if each["minus"] == "baseline:present_velocity")
    assert velocity["difference"] == {"value": 1, "low": 1, "high": 1}


def test_confidence_against_always_saying_the_share(judged: Judged):
    """What the other two futures see is said; it comes true where the first one sees the same, and nowhere else."""
    here = flights(0)
    share = np.mean(np.sign(here.realised[:, 0, 0]) == np.sign(here.predicted[:, 1, 0, 0]))
    assert 0.2 < share < 0.8
    assert values(judged, OURS, "came_true_voted") == pytest.approx(share, abs=1e-5)
    np.testing.assert_array_equal(judged.spoken[OURS].agreement == 1, judged.spoken[OURS].voted_true)
    found = confidence_of(judged, OURS)
    assert found["base_rate"]["value"] == pytest.approx(share, abs=1e-5)
    assert found["risk_at_80_minus_risk_all"]["value"] == pytest.approx((0.8 - share) / 0.8 - (1 - share), abs=1e-5)
    expected = values(judged, OURS, "brier") - share * (1 - share)
    assert found["brier_minus_base_rate"]["value"] == pytest.approx(expected, abs=2e-5)
    assert expected < -0.1


def test_without_refits_there_are_no_controls():
    here = flights(0)
    learnt = Learnt({OURS: words()}, {}, [StateRegressor("ridge", Nothing(), {})])
    names = judge(learnt, here, here, 5, TASK, episode_weights(here.episode, 20, 0), seed=0).samples
    assert OURS in names
    assert "baseline:flipped" not in names
