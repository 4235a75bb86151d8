"""From disagreement to expected error, also where members diverge."""

import warnings

import numpy as np

from ibe_rl.predict.trust import LARGEST_ERROR, Trust, in_units


def test_errors_are_a_root_mean_square_in_units() -> None:
    values, spread = np.array([[[3.0, 8.0]]], np.float32), np.array([[1.0, 2.0]], np.float32)
    np.testing.assert_allclose(in_units(values, spread), [[np.sqrt((9 + 16) / 2)]])


def test_members_that_diverge_are_not_trusted_and_raise_no_warning() -> None:
    diverged = np.array([1e30, np.inf, np.nan, 0.0], np.float32).reshape(1, 4, 1)
    trust = Trust(np.ones((1, 1), np.float32), error_per_gap=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        error = trust.expected_error(diverged)
    np.testing.assert_array_equal(error, [[LARGEST_ERROR, LARGEST_ERROR, LARGEST_ERROR, 0.0]])
    assert trust.trusted_steps(error, limit=0.5, horizon_steps=40).tolist() == [0]
