"""Does speech hold still? By hand."""

import math

import numpy as np
import pytest

from ibe_rl.metrics.stability import FLICKER_STEPS, LASTING_STEPS, changes_of, lags_steps, stability


def test_changes_and_those_that_are_undone():
    changed, undone = changes_of(list("aabaac"))
    assert np.flatnonzero(changed).tolist() == [2, 3, 5]
    assert np.flatnonzero(undone).tolist() == [2]  # back to b never, and c is the last


@pytest.mark.parametrize(("between", "undone"), [(FLICKER_STEPS, True), (FLICKER_STEPS + 1, False)])
def test_a_flicker_is_short(between: int, undone: bool):
    assert changes_of(["a", *["b"] * between, "a"])[1].any() == undone


def test_in_numbers():
    assert stability(list("aabaac")) == {"phrase_changes_per_100": 50.0, "flicker": pytest.approx(1 / 3)}
    still = stability(["a"] * 4)
    assert still["phrase_changes_per_100"] == 0
    assert math.isnan(still["flicker"])


def test_how_late_a_lasting_change_is_said():
    real = ["a"] * 20 + ["b"] * 20 + ["c"] * (LASTING_STEPS - 1) + ["d"] * 20
    said = ["a"] * 23 + ["b"] * 20 + ["d"] * 5 + ["x"] * 21
    assert lags_steps(said, real) == [3, pytest.approx(float("nan"), nan_ok=True)]
    assert lags_steps(["a"] * 15 + ["b"] * 54, real)[0] == -5
    assert lags_steps(["a"] * 9, ["a"] * 9) == []
