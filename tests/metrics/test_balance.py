"""Cluster sizes and expressions counted by hand."""

import numpy as np
import pytest

from ibe_rl.metrics.balance import left_right, size_cv, size_max


@pytest.mark.parametrize(
    ("sizes", "cv", "largest"),
    [
        ([5, 5, 5, 5], 0, 1 / 4),
        ([1, 3], 1 / 2, 3 / 4),
        ([0, 0, 0, 0, 10], 2, 1),  # sqrt(5 - 1)
        ([2, 4, 4, 4, 5, 5, 7, 9], 2 / 5, 9 / 40),
        ([7], 0, 1),
    ],
)
def test_how_evenly_clusters_are_used(sizes: list[int], cv: float, largest: float):
    assert size_cv(np.array(sizes)) == pytest.approx(cv)
    assert size_max(np.array(sizes)) == pytest.approx(largest)
    assert size_cv(np.array(sizes) * 0.01) == pytest.approx(cv)  # only shares count
    assert size_max(np.array(sizes) * 0.01) == pytest.approx(largest)


def test_empty_clusters_have_no_balance():
    assert np.isnan(size_cv(np.zeros(3)))
    assert np.isnan(size_max(np.zeros(3)))


@pytest.mark.parametrize(
    ("expressions", "sides"),
    [
        ([-1, -0.5, 0, 0.2, 0.3, 1], (2, 3)),
        ([-1, -1, 1, 1, 1], (1, 1)),
        ([0.1 + 0.2, 0.3, -1e-12, 1e-12, 0], (0, 1)),
        ([-2e-9, -4e-9, 2e-9], (2, 1)),
        ([], (0, 0)),
    ],
)
def test_distinct_expressions_on_either_side(expressions: list[float], sides: tuple[int, int]):
    assert left_right(np.array(expressions, float)) == sides
