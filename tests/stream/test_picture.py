"""Coordinates and colours."""

import numpy as np

from ibe_rl.stream import picture


def test_thinned_paths_keep_their_ends() -> None:
    for points in (60, 61):
        path = np.arange(2.0 * points).reshape(1, points, 2)
        thin = picture.thinned(path)
        assert thin.shape[1] == 31
        assert np.array_equal(thin[:, [0, -1]], path[:, [0, -1]])


def test_a_peak_that_hides_the_rest_is_cut() -> None:
    best, others = picture.cut([np.array([1.0, 30.0, 2.0]), np.array([3.0, 0.0, 0.0])])
    assert best.tolist() == [1.0, 6.0, 2.0]
    assert others.tolist() == [3.0, 0.0, 0.0]
    assert not np.any(picture.cut([np.zeros(3), np.zeros(3)]))


def test_a_held_explanation_was_made_when_it_was_first_said() -> None:
    one, other = object(), object()
    assert picture.made_at([one, one, other, other, one]).tolist() == [0, 0, 2, 2, 4]


def test_labels_keep_the_order_of_their_points_in_two_rows() -> None:
    places = picture.label_rows(np.array([[0.5, 0], [-0.9, 0], [0.4, 1]]), -1.0)
    assert np.argsort(places[:, 0]).tolist() == [1, 2, 0]
    assert places[:, 1].tolist() == [-1.0, -1.0, -1.16]


def test_ids_keep_their_colours_and_neighbours_differ() -> None:
    shades = picture.lasting(np.arange(12))
    assert len(np.unique(shades, axis=0)) == 12
    assert np.array_equal(picture.lasting(np.array([12, 3])), shades[[0, 3]])
