"""Means and intervals over runs, on values whose mean is known."""

from itertools import product

import numpy as np
import pytest

from ibe_rl.apps.sweep.intervals import common_frames, interquartile, interquartile_ratio, of_runs


def test_the_mean_is_that_of_the_middle_half() -> None:
    [one, other] = interquartile(np.array([[0.0, 5], [2, 5], [4, 5], [1000, 5]]), reps=200)
    assert one["value"] == 3
    assert 0 <= one["low"] < 3 < one["high"] <= 1000
    assert other == {"value": 5, "low": 5, "high": 5}


def test_the_interval_is_that_of_all_ways_to_draw_the_runs_again() -> None:
    runs = np.array([0.0, 1, 3, 10])
    all_ways = np.array(list(product(runs, repeat=4)))
    low, high = np.percentile(np.sort(all_ways)[:, 1:3].mean(axis=1), [2.5, 97.5])
    [found] = interquartile(runs[:, None], reps=20_000)
    assert found == {"value": 2, "low": pytest.approx(low), "high": pytest.approx(high)}


def test_nothing_else_that_is_drawn_at_random_changes() -> None:
    np.random.seed(1)  # noqa: NPY002 - the generator that is to be left alone
    before = np.random.get_state()[1].copy()  # noqa: NPY002 - the generator that is to be left alone
    interquartile(np.arange(4.0)[:, None], reps=20)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002 - the generator that is to be left alone


def test_the_same_runs_give_the_same_interval_and_more_runs_a_smaller_one() -> None:
    four = np.array([[0.0], [1], [2], [3]])
    few, again, many = (interquartile(values, reps=500) for values in (four, four, np.tile(four, (25, 1))))
    assert few == again
    assert many[0]["high"] - many[0]["low"] < (few[0]["high"] - few[0]["low"]) / 2


def test_one_run_has_no_interval_and_a_run_may_lack_a_metric() -> None:
    found, _ = of_runs([{"a": 1.0, "b": 2.0}, {"a": 3.0}, {"a": 5.0, "c": 7.0, "b": 2.0}], {})
    assert found["b"] == {"value": 2, "low": 2, "high": 2, "runs": 2, "each": [2, 2]}
    assert found["c"] == {"value": 7, "low": None, "high": None, "runs": 1, "each": [7]}
    assert (found["a"]["value"], found["a"]["runs"], found["a"]["each"]) == (3, 3, [1, 3, 5])
    assert list(found) == ["a", "b", "c"]


def test_curves_are_put_together_over_the_frames_they_share() -> None:
    long = np.array([10, 20, 30, 40]), np.array([1.0, 2, 3, 4])
    short = np.array([15, 25, 35]), np.array([0.0, 0, 0])
    ends, curves = of_runs([{"a": 3.0}, {"a": 4.0}], {"a": [long, short], "b": [long, long]})
    assert ends["a"]["value"] == 3.5
    assert curves["a"] == {
        "frames": [15, 25, 35],
        "value": [0.75, 1.25, 1.75],  # halfway between 0 and what lies between the rows
        "low": [0, 0, 0],
        "high": [1.5, 2.5, 3.5],
    }
    assert curves["b"]["value"] == curves["b"]["low"] == [1, 2, 3, 4]


def test_curves_without_common_frames_are_empty() -> None:
    _, curves = of_runs([{}, {}], {"a": [(np.array([1, 2]), np.zeros(2)), (np.array([5, 6]), np.zeros(2))]})
    assert curves == {"a": {"frames": [], "value": [], "low": [], "high": []}}


def test_a_long_curve_is_thinned_and_keeps_its_ends() -> None:
    frames = np.arange(1, 1001)
    found = common_frames([(frames, frames.astype(float))] * 2)
    assert (len(found), found[0], found[-1]) == (60, 1, 1000)


def test_a_ratio_is_that_of_the_interquartile_means():
    """Means of 2 and 4; 1000 and 5 are left out."""
    found = interquartile_ratio(np.array([1.0, 2, 2, 1000]), np.array([4.0, 4, 4, 5]))
    assert found["value"] == 0.5
    assert found["low"] < 0.5 < found["high"]
    assert interquartile_ratio(np.array([3.0]), np.array([6.0])) == {"value": 0.5, "low": 0.5, "high": 0.5}
