"""Places on a line divided in three ways, and sets of centres mirrored."""

import numpy as np
import pytest
from sklearn.metrics import pairwise_distances_argmin

from ibe_rl.ibe.split import SPLITS, mirrored, split, split_mirrored, with_rest
from ibe_rl.types import Array


def skewed(count: int = 4_000) -> Array:
    """Many places near 0 and few far away."""
    return np.random.default_rng(0).exponential(size=(count, 1)) ** 2


def centres(places: Array, k: int, how: str, counts: Array | None = None, first: Array | None = None) -> Array:
    found = split(places, np.ones(len(places)) if counts is None else counts, k, how, 4, first, 0)
    assert found.shape == (k, places.shape[1])
    return found


def sizes(how: str, k: int = 8) -> Array:
    places = skewed()
    return np.sort(np.bincount(pairwise_distances_argmin(places, centres(places, k, how)), minlength=k))


def test_clusters_are_balanced_as_the_split_says():
    """K-means puts most of a skewed sample into one cluster, halving the largest less, quantiles least."""
    largest = {how: sizes(how)[-1] / 4_000 for how in SPLITS}
    smallest = {how: sizes(how)[0] / 4_000 for how in SPLITS}
    assert largest["kmeans"] > 0.5
    assert largest["kmeans"] > largest["bisecting"] > largest["quantile"]
    assert largest["quantile"] < 0.2
    assert smallest["quantile"] > 0.05 > smallest["kmeans"]


def test_quantiles_are_the_middles_of_equal_shares():
    assert centres(np.arange(100.0)[:, None], 4, "quantile")[:, 0].tolist() == [12, 37, 62, 87]
    counts = np.repeat([3.0, 1.0], 50)  # the first half counts three times: as if there were 200
    assert centres(np.arange(100.0)[:, None], 4, "quantile", counts)[:, 0].tolist() == [8, 24, 41, 74]


@pytest.mark.parametrize("how", SPLITS)
def test_obvious_groups_are_found(how: str):
    places = np.repeat([-5.0, 0.0, 5.0], 20)[:, None]
    np.testing.assert_allclose(np.sort(centres(places, 3, how), axis=0), [[-5], [0], [5]], atol=1e-9)


@pytest.mark.parametrize("how", ["kmeans", "bisecting"])
def test_what_counts_more_pulls_more(how: str):
    places = np.array([[-10.0], [-10], [0], [4]])
    found = np.sort(centres(places, 2, how, np.array([1.0, 1, 3, 1])), axis=0)
    np.testing.assert_allclose(found, [[-10], [1]])


def test_k_means_starts_where_asked_and_stays_in_that_grouping():
    places = np.repeat([0.0, 1.0, 10.0, 11.0, 20.0, 21.0], 5)[:, None]
    start = np.array([[0.0], [1.0], [15.5]])
    np.testing.assert_allclose(np.sort(centres(places, 3, "kmeans", first=start), axis=0), start)
    np.testing.assert_allclose(np.sort(centres(places, 3, "kmeans"), axis=0), [[0.5], [10.5], [20.5]])


def test_another_split_is_refused():
    with pytest.raises(ValueError, match="split='halves': choose one of kmeans, bisecting, quantile"):
        centres(skewed(), 2, "halves")


def test_each_centre_is_averaged_with_its_opposite():
    np.testing.assert_allclose(mirrored(np.array([[3.0], [-1.0]])), [[2], [-2]])
    np.testing.assert_allclose(mirrored(np.array([[3.0], [0.3], [-1.0]])), [[2], [0], [-2]])
    np.testing.assert_allclose(mirrored(np.array([[3.0, 1], [-1, -2]])), [[2, 1.5], [-2, -1.5]])


def test_a_set_that_is_its_own_mirror_image_stays():
    own = np.array([[-2.0], [-0.5], [0.0], [0.5], [2.0]])
    np.testing.assert_array_equal(mirrored(own), own)


def test_pairs_are_mutual_where_others_are_as_near():
    """Of -1, 2 and 3 every pairing has the same sum of distances."""
    assert mirrored(np.array([[-1.0], [2.0], [3.0]]))[:, 0].tolist() == [-2, 0, 2]


@pytest.mark.parametrize("seed", range(20))
def test_whatever_the_centres_on_a_line_their_mirror_image_is_the_same_set(seed: int):
    random = np.random.default_rng(seed)
    found = np.sort(mirrored(random.normal(size=(int(random.integers(2, 12)), 1))), axis=0)
    np.testing.assert_allclose(found, -found[::-1], atol=1e-12)


@pytest.mark.parametrize("k", [2, 3, 8, 9])
@pytest.mark.parametrize("how", SPLITS)
def test_places_and_their_opposites_are_divided_alike(how: str, k: int):
    places = skewed(1_000) - 0.2
    found = np.sort(split_mirrored(places, np.ones(1_000), k, how, 4, None, 0), axis=0)
    assert len(np.unique(found)) == k
    np.testing.assert_allclose(found, -found[::-1], atol=1e-9)


def test_a_mirrored_division_is_settled():
    """Of three equal groups the best two clusters are lopsided; mirrored, the one in the middle is shared."""
    places = np.random.default_rng(0).normal(np.repeat([-1.0, 0, 1], 200), 0.05)[:, None]
    settled = split_mirrored(places, np.ones(600), 2, "kmeans", 4, None, 0)
    again = split_mirrored(places, np.ones(600), 2, "kmeans", 4, settled, 0)
    np.testing.assert_allclose(np.sort(again, axis=0), np.sort(settled, axis=0), atol=1e-6)
    np.testing.assert_allclose(np.sort(settled, axis=0)[:, 0], [-2 / 3, 2 / 3], atol=0.05)


def test_a_pair_is_put_at_rest_where_none_is():
    apart = np.array([[-0.9], [-0.5], [-0.2], [0.2], [0.5], [0.9]])
    rested = with_rest(apart, 1.0)
    np.testing.assert_allclose(rested[:, 0], [-0.9, -0.5, -0.05, 0.05, 0.5, 0.9])
    assert apart[2] == -0.2  # its own
    rooted = with_rest(apart, 1 / 3)  # .2 there is a movement of .008
    np.testing.assert_array_equal(rooted, apart)
    np.testing.assert_allclose(with_rest(apart + np.sign(apart) * 0.3, 1 / 3)[2:4, 0] ** 3, [-0.05, 0.05])


def test_of_several_numbers_the_pair_are_opposites():
    apart = np.array([[0.3, -0.3], [0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3]])
    rested = with_rest(apart, 1.0)
    np.testing.assert_allclose(rested, [[0.05, -0.05], [0.3, 0.3], [-0.05, 0.05], [-0.3, -0.3]])


@pytest.mark.parametrize("centres", [[-0.9, -0.03, 0.03, 0.9], [-0.9, -0.5, 0, 0.5, 0.9], [-0.5, 0.5], [-0.5, 0, 0.5]])
def test_what_has_rest_or_is_too_few_stays(centres: list[float]):
    own = np.array(centres)[:, None]
    np.testing.assert_array_equal(with_rest(own, 1.0), own)
