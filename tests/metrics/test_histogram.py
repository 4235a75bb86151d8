"""Densities worked out by hand."""

import numpy as np

from ibe_rl.metrics.histogram import BINS, bin_edges, densities


def test_bins_lie_about_no_change_and_hold_nearly_all() -> None:
    changes = np.append(np.linspace(-2, 2, 1_000), 500.0)
    edges = bin_edges(changes)
    assert len(edges) == BINS + 1
    assert np.allclose(edges, -edges[::-1])
    assert 1.9 < edges[-1] < 2.1


def test_without_any_change_bins_have_a_width_all_the_same() -> None:
    for nothing in (np.zeros(0), np.zeros(5)):
        assert bin_edges(nothing, 4).tolist() == [-1, -0.5, 0, 0.5, 1]


def test_each_group_has_the_density_of_its_own_changes() -> None:
    two, none = densities([np.array([-0.3, 0.2, 0.3, 9.0]), np.zeros(0)], np.array([-0.5, 0.0, 0.5]))
    assert two.tolist() == [0.5, 1.0]  # a quarter and a half of them, in bins half a unit wide; one lies outside
    assert none.tolist() == [0, 0]
