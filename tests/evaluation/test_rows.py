"""Metrics of one explainer against those of the package and of scikit-learn."""

import numpy as np
import pytest
from by_hand import WORDS
from lift import TASK, moments, words

from ibe_rl.evaluation.controls import Flipped
from ibe_rl.evaluation.rows import (
    Truth,
    balance,
    difference,
    estimate_json,
    fixed,
    score_confidence,
    score_motion,
    score_words,
    spread_over,
)
from ibe_rl.evaluation.verbalise import speak
from ibe_rl.metrics.bootstrap import episode_weights

HERE = moments(
    realised=[2, -2, 0, 2],
    predicted=[[2, 2, 2], [2, -2, -2], [0, 2, -2], [-2, 0, 0]],
    instruction=[1, -1, 0, -1],
    episode=[0, 0, 1, 1],
)
WEIGHTS = episode_weights(HERE.episode, 50, 0)


def truth() -> Truth:
    return Truth.of(HERE, 5, TASK, np.array([[2.0], [2.0], [0.0], [2.0]]), WEIGHTS)


def test_the_truth_is_the_change_and_what_a_forecast_gets_wrong_is_hard():
    real = truth()
    assert real.change.tolist() == [[2], [-2], [0], [2]]
    assert real.hard[:, 0].tolist() == [False, True, False, False]
    assert real.instruction.tolist() == [[1], [-1], [0], [-1]]
    assert real.unweighed().weights.tolist() == [[1, 1, 1, 1]]


def test_the_true_change_tells_the_motion_perfectly():
    scores = score_motion(truth().change, truth(), np.sign(truth().change))
    assert scores["motion_auc"][0] == 1
    assert scores["motion_spearman"][0] == pytest.approx(1)
    assert np.isnan(scores["motion_auc_hard"][0])  # one hard moment has nothing to be distinguished from
    assert scores["instruction_f1"][0] < 1


def test_words_and_confidence():
    spoken = speak(words(), HERE, 5, [WORDS])
    found = score_words(spoken, truth())
    assert (found["came_true"][0], found["came_true_voted"][0]) == (0.5, 0.75)
    sure = score_confidence(np.array([0.9, 0.2, 0.9, 0.2]), spoken.true, truth(), spoken.known)
    assert sure["brier"][0] == pytest.approx((2 * 0.1**2 + 2 * 0.2**2) / 4, rel=1e-5)
    assert sure["risk_all"][0] == 0.5
    assert sure["risk_at_80"][0] == pytest.approx((0.8 * 4 - 2) / (0.8 * 4))


def test_balance_is_reported_where_there_are_clusters():
    found = balance(words((-4, -2, 0, 2), (-1, -0.5, 0, 1)))
    assert found["left_right"] == {"value": [2, 1], "low": None, "high": None}
    assert found["size_cv"]["value"] == 0
    assert found["size_max"]["value"] == 0.25
    assert balance(Flipped(words())) == {}


def test_values_for_a_report():
    assert estimate_json(np.array([0.123456789])) == {"value": 0.12346, "low": None, "high": None}
    assert fixed(2) == {"value": 2.0, "low": None, "high": None}
    assert spread_over([float("nan"), 0.0, 1.0]) == {"value": 0.5, "low": 0.025, "high": 0.975}
    assert spread_over([float("nan")]) == {"value": None, "low": None, "high": None}


def test_a_difference_is_paired():
    one, other = {"a": np.array([3.0, 5, 9])}, {"a": np.array([1.0, 3, 7])}
    assert difference(one, other, "a") == {"value": 2.0, "low": 2.0, "high": 2.0}
    assert difference(one, {}, "a") is None
