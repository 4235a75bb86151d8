"""The paper's mapping, which is the estimator as it stands, on changes that fall into obvious groups."""

from typing import Any

import numpy as np
import pytest
from groups import DOWN, LEFT, RIGHT, fit, groups, weight
from sklearn.base import clone
from sklearn.cluster import KMeans
from sklearn.exceptions import NotFittedError

from ibe_rl.ibe import ClusterMapping, IBEMapping, TooLittleDataError
from ibe_rl.types import Array


@pytest.fixture
def mapping() -> ClusterMapping:
    return fit().mapping_


@pytest.mark.parametrize("seed", range(5))  # k-means numbers its clusters as it likes
def test_each_cluster_has_the_mean_of_its_instructions_in_rising_order(seed: int):
    mapping = fit(random_state=seed).mapping_
    np.testing.assert_allclose(mapping.expressions, [[-1], [2 * 0.75 / 1.75 - 1], [1]])
    assert mapping.cluster(np.array([LEFT, DOWN, RIGHT])).tolist() == [0, 1, 2]
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.75], [0.0], [1.0]])
    assert mapping.sizes.tolist() == [4, 6, 2]
    np.testing.assert_allclose(mapping.purities, [0.75, 4 / 6, 1.0])


def test_expressions_are_normalised_as_asked():
    np.testing.assert_allclose(fit(normalisation="sign").mapping_.expressions, [[-0.75], [0], [1]])


def test_changes_are_standardised_before_they_are_clustered(mapping: ClusterMapping):
    delta, instruction = groups()
    np.testing.assert_allclose(mapping.space.mean, delta.mean(axis=0))
    np.testing.assert_allclose(weight(mapping), 1 / delta.std(axis=0))
    stretched = IBEMapping(3, random_state=0).fit(delta * [1, 1000], instruction).mapping_
    np.testing.assert_allclose(stretched.sizes, mapping.sizes)
    np.testing.assert_allclose(stretched.express(delta * [1, 1000]), mapping.express(delta))


def test_labels_and_predictions_agree_with_the_mapping():
    estimator, (delta, _) = fit(), groups()
    assert np.bincount(estimator.labels_).tolist() == [4, 6, 2]
    np.testing.assert_array_equal(estimator.predict(delta), estimator.mapping_.expressions[estimator.labels_])


def test_a_dimension_left_out_changes_nothing():
    sideways = fit(n_clusters=2, dimensions=[0]).mapping_
    far = np.array([[-3.0, 0.0], [-3.0, 1e6], [3.0, 0.0], [3.0, -1e6]])
    clusters = sideways.cluster(far)
    assert clusters[0] == clusters[1] != clusters[2] == clusters[3]
    assert weight(sideways)[1] == 0 < weight(sideways)[0]


def test_a_dimension_that_never_changes_does_no_harm():
    delta, instruction = groups()
    still = np.column_stack([delta, np.full(12, 0.5)])
    mapping = IBEMapping(3, random_state=0).fit(still, instruction).mapping_
    assert np.isfinite(weight(mapping)).all()
    assert mapping.sizes.tolist() == [4, 6, 2]


def test_instructions_of_several_numbers_are_averaged_each():
    delta, instruction = groups()
    mapping = IBEMapping(3, random_state=0).fit(delta, np.column_stack([instruction, -instruction])).mapping_
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.75, 0.75], [0, 0], [1, -1]], atol=1e-12)
    np.testing.assert_allclose(mapping.expressions[:, 1], -mapping.expressions[:, 0])


def test_equal_means_are_expressed_as_nothing():
    delta, _ = groups()
    assert not IBEMapping(3, random_state=0).fit(delta, np.ones(12)).mapping_.expressions.any()


def test_sizes_and_means_are_of_all_windows_however_few_are_clustered():
    delta, instruction = groups()
    many = np.tile(delta, (50, 1)) + np.random.default_rng(2).normal(0, 0.02, (600, 2))
    mapping = IBEMapping(3, max_fit_windows=120, random_state=0).fit(many, np.tile(instruction, 50)).mapping_
    assert mapping.sizes.tolist() == [200, 300, 100]
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.75], [0.0], [1.0]], atol=1e-12)


def test_a_cluster_without_a_window_says_what_all_were_instructed(monkeypatch: pytest.MonkeyPatch):
    class OneTooMany(KMeans):
        def fit(self, X: Array, sample_weight: Array) -> "OneTooMany":
            super().fit(X, sample_weight=sample_weight)
            self.cluster_centers_ = np.vstack([self.cluster_centers_, [[99.0, 99.0]]])
            return self

    monkeypatch.setattr("ibe_rl.ibe.split.KMeans", OneTooMany)
    mapping = fit().mapping_
    [empty] = np.flatnonzero(mapping.sizes == 0)
    assert mapping.mean_instructions[empty] == pytest.approx(groups()[1].mean())
    assert mapping.purities[empty] == 0


def test_the_same_seed_learns_the_same():
    random = np.random.default_rng(0)
    delta, instruction = random.normal(size=(300, 4)), random.integers(-1, 2, 300)

    def learn(seed: int) -> dict[str, Any]:
        return (
            IBEMapping(8, n_init=1, max_fit_windows=200, random_state=seed).fit(delta, instruction).mapping_.to_dict()
        )

    assert learn(3) == learn(3)
    assert learn(3) != learn(4)


def test_a_new_mapping_numbers_its_clusters_and_stands_on_its_windows(mapping: ClusterMapping):
    assert mapping.ids.tolist() == [0, 1, 2]
    assert mapping.ids.dtype.kind == "i"
    assert mapping.evidence.tolist() == mapping.sizes.tolist() == [4, 6, 2]


def test_few_distinct_windows_make_fewer_clusters():
    delta, instruction = np.repeat([-2.0, 0.0, 1.0], 10)[:, None], np.repeat([-1.0, 0.0, 1.0], 10)
    learnt = IBEMapping(8, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(learnt.centre_changes(), [[-2], [0], [1]], atol=1e-9)
    assert learnt.expressions[:, 0].tolist() == [-1, 0, 1]
    assert learnt.sizes.tolist() == [10, 10, 10]


def test_mirror_images_count_as_distinct_windows():
    """Quarter turns: -1, 0, 1 and 2 have the mirror image -2, so five clusters."""
    delta, instruction = np.repeat([-1.0, 0.0, 1.0, 2.0], 10)[:, None], np.repeat([-1.0, 0.0, 1.0, 1.0], 10)
    axis: dict[str, Any] = {"space": "lasso", "symmetric": True, "normalisation": "movement", "power": 1 / 3}
    learnt = IBEMapping(8, **axis, random_state=0).fit(delta, instruction).mapping_
    np.testing.assert_allclose(learnt.centre_changes(), [[-2], [-1], [0], [1], [2]], atol=1e-9)
    assert learnt.sizes.tolist() == [0, 10, 10, 10, 10]


def test_one_distinct_window_is_too_little():
    with pytest.raises(TooLittleDataError, match="1 distinct windows for n_clusters=3: at least 2 are needed"):
        IBEMapping(3).fit(np.array([LEFT, LEFT] * 10), np.zeros(20))
    with pytest.raises(TooLittleDataError, match="1 distinct windows for n_clusters=2"):  # in what is left of them
        IBEMapping(2, dimensions=[0]).fit(np.array([[1.0, 0.0], [1.0, 5.0]]), np.zeros(2))


@pytest.mark.parametrize("instruction", [np.zeros(0), np.zeros((0, 1))])
def test_no_windows_are_too_little(instruction: Array):
    with pytest.raises(TooLittleDataError, match="0 distinct windows for n_clusters=3"):
        IBEMapping(3).fit(np.zeros((0, 2)), instruction)


def test_impossible_arguments_are_refused():
    with pytest.raises(ValueError, match="n_clusters=1: at least 2"):
        fit(n_clusters=1)
    with pytest.raises(ValueError, match="3 windows but 2 instructions"):
        IBEMapping(2).fit(np.zeros((3, 2)), np.zeros(2))
    with pytest.raises(ValueError, match="normalisation='other'"):
        fit(normalisation="other")
    with pytest.raises(NotFittedError):
        IBEMapping().predict(np.zeros((1, 2)))


def test_it_is_an_estimator():
    estimator = IBEMapping(n_clusters=5, normalisation="sign", dimensions=[0, 2], n_init=2, random_state=7)
    assert clone(estimator).get_params() == estimator.get_params()
    assert estimator.get_params()["n_clusters"] == 5
