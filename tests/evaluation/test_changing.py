"""A policy is spoken of in the vocabularies of its own age and before, never in later ones."""

import numpy as np
from lift import TASK, moments, words

from ibe_rl.evaluation.changing import AGE_METRICS, judge_ages

CHANGE = [2, -2, 0, 2, -2, 0]
HERE = moments(CHANGE, [[change] for change in CHANGE], [1, 1, 1, -1, -1, -1], [0, 0, 0, 1, 1, 1])
WRONG, RIGHT = words(expressions=(1, 0, -1)), words()


def test_the_own_age_against_earlier_ones():
    rows = judge_ages(300, {300: RIGHT, 100: WRONG, 200: RIGHT, 400: WRONG}, HERE, 5, TASK, 40, 0)
    assert [(row["policy_frame"], row["vocabulary_frame"]) for row in rows] == [(300, 100), (300, 200), (300, 300)]
    assert [row["motion_auc"]["value"] for row in rows] == [0, 1, 1]
    assert [row["came_true"]["value"] for row in rows] == [
        1,
        1,
        1,
    ]  # the wrong one calls what came the same wrong thing
    gains = [row["refreshed_minus_this"]["motion_auc"] for row in rows]
    assert gains == [{"value": 1, "low": 1, "high": 1}, *[{"value": 0, "low": 0, "high": 0}] * 2]
    assert all(set(AGE_METRICS) == set(row["refreshed_minus_this"]) for row in rows)


def test_a_policy_from_before_the_first_vocabulary_has_no_rows():
    assert judge_ages(50, {100: RIGHT}, HERE, 5, TASK, 40, 0) == []
    assert np.isclose(judge_ages(100, {100: RIGHT}, HERE, 5, TASK, 40, 0)[0]["motion_spearman"]["value"], 1)
