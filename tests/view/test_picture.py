"""Coordinates."""

import numpy as np

from ibe_rl.ibe import ClusterMapping
from ibe_rl.ibe.space import along
from ibe_rl.view import picture


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


def beside(delta: np.ndarray, centres: np.ndarray, explained: int = 0) -> int:
    """The second dimension for clusters that the first number tells apart."""
    k, ones = len(centres), np.ones(len(centres))
    said = np.linspace(-1, 1, k)[:, None]
    mapping = ClusterMapping(
        along(np.array([[1.0], [0], [0]])), centres[:, :1], said, said, ones, ones, ones, np.arange(k)
    )
    return picture.second_dimension(mapping, explained, delta)


def around(centres: np.ndarray, scale: list[float]) -> np.ndarray:
    random = np.random.default_rng(0)
    return np.concatenate([centre + random.normal(size=(50, len(centre))) * scale for centre in centres])


def test_the_second_dimension_is_the_one_that_tells_clusters_apart() -> None:
    """They are as far apart in the second number, but there that is little beside how much it changes."""
    centres = np.array([[-9.0, -4, -4], [0, 4, 0], [9, -4, 4]])
    assert beside(around(centres, [1, 40, 1]), centres) == 2
    assert beside(around(centres, [1, 1, 40]), centres) == 1
    assert beside(around(centres, [1, 40, 1]), centres, explained=2) == 0


def test_a_dimension_of_few_values_comes_last_and_one_that_stands_still_is_none() -> None:
    centres = np.array([[-9.0, -4, -1], [0, 0, 0], [9, 4, 1]])
    delta = around(centres, [1, 1, 1])
    delta[:, 1] = np.sign(delta[:, 0])  # a flag, and quite telling
    assert beside(delta, centres) == 2
    delta[:, 2] = 0
    assert beside(delta, centres) in (1, 2)


def test_a_cluster_that_no_window_falls_into_has_no_say() -> None:
    centres = np.array([[-9.0, -1, 0], [9, 1, 0], [0, 0, 1e6]])
    assert beside(around(centres[:2], [1, 1, 1]), centres) == 1
