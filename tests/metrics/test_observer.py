"""What a listener expects, and how far it is off."""

import numpy as np
import pytest

from ibe_rl.metrics.observer import Observer, calibrate_observer, carries_on, observer_errors


def test_the_typical_movement_is_that_of_the_moments_that_moved():
    assert calibrate_observer(np.array([-3.0, 0.2, -0.5, 0.5, 1, 2]), band=0.5) == Observer(typical=2.0)


def test_the_side_does_not_matter_for_how_far():
    change = np.array([0.0, 1, 2, 4])
    assert calibrate_observer(change, 0.5) == calibrate_observer(-change, 0.5)


@pytest.mark.parametrize("change", [[], [0.0, 0.5, -0.5]])
def test_where_nothing_ever_moved_there_is_nothing_to_read(change: list[float]):
    observer = calibrate_observer(np.array(change), band=0.5)
    assert np.isnan(observer.typical)
    assert np.isnan(observer.reads(np.zeros(1), np.ones(1))).all()


def test_an_expression_is_a_movement_on_one_scale():
    positions, said = np.array([0.0, 1, 1, -2]), np.array([1.0, -1, 0, 0.25])
    assert Observer(typical=2.0).reads(positions, said).tolist() == [2, -1, 1, -1.5]


def test_it_cannot_relearn_a_code():
    """After calibration on the same motion the flipped code is wrong by twice the movement."""
    change = np.array([-1.0, 1, 1, -1])
    observer = calibrate_observer(change, 0.5)
    start = np.zeros(4)
    assert observer_errors(observer.reads(start, change), change, 4).tolist() == [0] * 4
    assert observer_errors(observer.reads(start, -change), change, 4).tolist() == [50] * 4


def test_without_an_explanation_the_motion_goes_on():
    positions, speeds = np.array([0.0, 1, 1]), np.array([0.1, -0.2, 0])
    assert carries_on(positions, speeds, 10) == pytest.approx([1, -1, 1])
    assert carries_on(positions, speeds, np.array([10, 5, 3])) == pytest.approx([1, 0, 1])


def test_the_error_is_in_percent_of_the_width():
    assert observer_errors(np.array([0.5, -0.5, 1]), np.array([0.0, 0.5, 1]), 2.0).tolist() == [25, 50, 0]


@pytest.mark.parametrize("width", [0.0, -2.0, float("nan")])
def test_a_width_is_above_0(width: float):
    with pytest.raises(ValueError, match=f"width={width}: allowed is above 0"):
        observer_errors(np.zeros(1), np.zeros(1), width)
