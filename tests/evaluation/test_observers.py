"""The observer foretells where the lift will be, worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from lift import TASK, moments, words

from ibe_rl.evaluation.controls import Flipped
from ibe_rl.evaluation.observers import NO_EXPLANATION, add_errors, observe_all

OURS = "ibe:lift"
HERE = moments(
    realised=[2, -2, 9],
    predicted=[[3], [-2], [9]],
    instruction=[0, 0, 0],
    episode=[0, 1, 1],
    speed=[2, 2, 2],
    observed=[True, True, False],
)
TRUE_CHANGE = np.array([[2.0], [-2], [2], [0.1], [0]])  # typically two metres, if it moves at all


def test_errors_are_in_percent_of_the_range():
    vocabularies = {OURS: [words()], "baseline:flipped": [Flipped(words())], "both": [words(), Flipped(words())]}
    samples, report = observe_all(HERE, TRUE_CHANGE, 5, TASK, vocabularies, 50, 0)
    found = {row["explainer"]: row["observer_error"]["value"] for row in report["rows"]}
    assert report["episodes"] == 2
    assert report["typical"] == 2
    assert found[OURS] == found["baseline:true_future"] == 0  # +1 is read as two metres up
    assert found["baseline:flipped"] == pytest.approx(100 * 4 / 20)
    assert found["both"] == pytest.approx(100 * 2 / 20)
    assert found[NO_EXPLANATION] == pytest.approx(100 * (1 + 3) / 2 / 20)  # goes on for one metre up
    assert found["baseline:predicted_change"] == pytest.approx(100 * 1 / 2 / 20)
    less = next(row["minus_no_explanation"] for row in report["rows"] if row["explainer"] == OURS)
    assert less["value"] == -found[NO_EXPLANATION]
    assert less["low"] <= less["value"] <= less["high"] < 0
    assert samples[OURS]["observer_error"].shape == (51,)


def test_errors_are_held_against_the_papers_if_it_was_heard():
    both = {OURS: [words()], "baseline:paper": [Flipped(words())]}
    rows = observe_all(HERE, TRUE_CHANGE, 5, TASK, both, 20, 0)[1]["rows"]
    assert {row["explainer"]: row["minus_paper"]["value"] for row in rows}[OURS] == pytest.approx(-100 * 4 / 20)
    assert observe_all(HERE, TRUE_CHANGE, 5, TASK, {OURS: [words()]}, 20, 0)[1]["rows"][0]["minus_paper"] is None


def test_an_observer_that_never_saw_a_movement_reads_nothing():
    report = observe_all(HERE, 0 * TRUE_CHANGE, 5, TASK, {OURS: [words()]}, 20, 0)[1]
    assert report["typical"] is None
    found = {row["explainer"]: row["observer_error"]["value"] for row in report["rows"]}
    assert found[OURS] is None
    assert found["baseline:true_future"] == 0


def test_errors_go_into_the_rows_of_their_horizon():
    samples, _ = observe_all(HERE, TRUE_CHANGE, 5, TASK, {OURS: [words()]}, 20, 0)
    rows = [{"explainer": name, "horizon_steps": steps} for name in (OURS, "other") for steps in (5, 9)]
    add_errors(rows, samples, 5)
    assert ["observer_error" in row for row in rows] == [True, False, False, False]


def test_without_motion_or_a_contact_nobody_observes():
    assert observe_all(HERE, TRUE_CHANGE, 5, replace(TASK, motion=None), {}, 20, 0)[0] == {}
    assert observe_all(HERE[~HERE.observed], TRUE_CHANGE, 5, TASK, {}, 20, 0)[1] == {"episodes": 0, "rows": []}
