"""The paper's mapping on changes that fall into obvious groups."""

import json
from typing import Any

import numpy as np
import pytest
from by_hand import on_a_line
from sklearn.base import clone
from sklearn.cluster import KMeans
from sklearn.exceptions import NotFittedError

from ibe_rl.data import Array
from ibe_rl.ibe import ClusterMapping, IBEMapping, TooLittleDataError

LEFT, DOWN, RIGHT = [-3.0, 0.0], [0.0, -3.0], [3.0, 0.0]


def groups() -> tuple[Array, Array]:
    """Four windows to the left, six straight down, two to the right, with what had been said before each."""
    near = np.random.default_rng(0).normal(0, 0.05, (12, 2))
    delta = np.array([LEFT] * 4 + [DOWN] * 6 + [RIGHT] * 2) + near
    told = np.array([-1, -1, -1, 0, 0, 0, 0, 0, 1, -1, 1, 1], float)
    order = np.random.default_rng(1).permutation(12)
    return delta[order], told[order]


def fit(**settings: Any) -> IBEMapping:
    return IBEMapping(**({"n_clusters": 3, "random_state": 0} | settings)).fit(*groups())


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


def test_any_change_is_given_to_the_nearest_centre(mapping: ClusterMapping):
    new = np.array([LEFT, DOWN, RIGHT, [9.0, 1.0]])
    assert mapping.cluster(new).tolist() == [0, 1, 2, 2]
    np.testing.assert_allclose(mapping.express(new), mapping.expressions[[0, 1, 2, 2]])
    np.testing.assert_allclose(mapping.confidence(new), mapping.purities[[0, 1, 2, 2]])


def test_changes_are_standardised_before_they_are_clustered(mapping: ClusterMapping):
    delta, told = groups()
    np.testing.assert_allclose(mapping.mean, delta.mean(axis=0))
    np.testing.assert_allclose(mapping.weight, 1 / delta.std(axis=0))
    stretched = IBEMapping(3, random_state=0).fit(delta * [1, 1000], told).mapping_
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
    assert sideways.weight[1] == 0 < sideways.weight[0]


def test_a_dimension_that_never_changes_does_no_harm():
    delta, told = groups()
    still = np.column_stack([delta, np.full(12, 0.5)])
    mapping = IBEMapping(3, random_state=0).fit(still, told).mapping_
    assert np.isfinite(mapping.weight).all()
    assert mapping.sizes.tolist() == [4, 6, 2]


def test_instructions_of_several_numbers_are_averaged_each():
    delta, told = groups()
    mapping = IBEMapping(3, random_state=0).fit(delta, np.column_stack([told, -told])).mapping_
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.75, 0.75], [0, 0], [1, -1]], atol=1e-12)
    np.testing.assert_allclose(mapping.expressions[:, 1], -mapping.expressions[:, 0])


def test_equal_means_are_expressed_as_nothing():
    delta, _ = groups()
    assert not IBEMapping(3, random_state=0).fit(delta, np.ones(12)).mapping_.expressions.any()


def test_sizes_and_means_are_of_all_windows_however_few_are_clustered():
    delta, told = groups()
    many = np.tile(delta, (50, 1)) + np.random.default_rng(2).normal(0, 0.02, (600, 2))
    mapping = IBEMapping(3, max_fit_windows=120, random_state=0).fit(many, np.tile(told, 50)).mapping_
    assert mapping.sizes.tolist() == [200, 300, 100]
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.75], [0.0], [1.0]], atol=1e-12)


def test_a_cluster_without_a_window_says_what_all_were_told(monkeypatch: pytest.MonkeyPatch):
    class OneTooMany(KMeans):
        def fit(self, X: Array, sample_weight: Array) -> "OneTooMany":
            super().fit(X, sample_weight=sample_weight)
            self.cluster_centers_ = np.vstack([self.cluster_centers_, [[99.0, 99.0]]])
            return self

    monkeypatch.setattr("ibe_rl.ibe.mapping.KMeans", OneTooMany)
    mapping = fit().mapping_
    [empty] = np.flatnonzero(mapping.sizes == 0)
    assert mapping.mean_instructions[empty] == pytest.approx(groups()[1].mean())
    assert mapping.purities[empty] == 0


def test_the_same_seed_learns_the_same():
    random = np.random.default_rng(0)
    delta, told = random.normal(size=(300, 4)), random.integers(-1, 2, 300)

    def learn(seed: int) -> dict[str, Any]:
        return IBEMapping(8, n_init=1, max_fit_windows=200, random_state=seed).fit(delta, told).mapping_.to_dict()

    assert learn(3) == learn(3)
    assert learn(3) != learn(4)


def test_clusters_start_where_they_are_told():
    """Six groups in a row, three clusters: k-means stays in the grouping it is started in, or finds its own."""
    delta = np.repeat([0.0, 1.0, 10.0, 11.0, 20.0, 21.0], 5)[:, None]
    told = np.repeat([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0], 5)
    start = on_a_line([0.0, 1.0, 15.5])  # a poor grouping that no step of k-means leaves
    learnt = IBEMapping(3, last=start, random_state=0).fit(delta, told).mapping_
    np.testing.assert_allclose(np.sort(learnt.centre_changes(), axis=0), start.centres, atol=1e-9)
    free = IBEMapping(3, random_state=0).fit(delta, told).mapping_
    np.testing.assert_allclose(np.sort(free.centre_changes(), axis=0), [[0.5], [10.5], [20.5]], atol=1e-9)


def remembering(memory: float) -> IBEMapping:
    """Ten old windows at -4 told -1 and twenty at 4 told 1; now five at -2 told 0 and ten at 6 told 1."""
    last = on_a_line([-4, 4], evidence=[10, 20])
    delta, told = np.repeat([-2.0, 6.0], [5, 10])[:, None], np.repeat([0.0, 1.0], [5, 10])
    return IBEMapping(2, last=last, memory=memory, random_state=0).fit(delta, told)


def test_earlier_windows_count_as_much_as_is_remembered_of_them():
    """At one half: five old windows with five new ones, ten with ten."""
    mapping = remembering(0.5).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-3], [5]])
    np.testing.assert_allclose(mapping.mean_instructions, [[-0.5], [1]])
    assert mapping.evidence.tolist() == [10, 20]
    assert mapping.sizes.tolist() == [5, 10]
    assert mapping.purities.tolist() == [1, 1]  # of what is really there
    np.testing.assert_allclose(remembering(0.9).mapping_.centre_changes(), [[-4 + 2 * 5 / 14], [4 + 2 * 10 / 28]])
    np.testing.assert_allclose(remembering(0.9).mapping_.mean_instructions[0], -9 / 14)


def test_standardisation_remembers_too():
    """At one half: fifteen old windows of mean 0 and variance 1, fifteen new ones of mean 10/3 and variance 128/9."""
    mapping = remembering(0.5).mapping_
    np.testing.assert_allclose(mapping.mean, (0 + 10 / 3) / 2)
    np.testing.assert_allclose(mapping.weight, ((1 + 128 / 9) / 2) ** -0.5)
    more = remembering(0.9).mapping_  # 27 against 15
    np.testing.assert_allclose(more.mean, 15 / 42 * 10 / 3)
    np.testing.assert_allclose(more.weight, (27 / 42 * 1 + 15 / 42 * 128 / 9) ** -0.5)


def test_without_memory_the_last_vocabulary_is_a_start_only():
    mapping = remembering(0.0).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-2], [6]])
    np.testing.assert_allclose(mapping.mean_instructions, [[0], [1]])
    assert mapping.evidence.tolist() == mapping.sizes.tolist() == [5, 10]
    np.testing.assert_allclose([mapping.mean[0], mapping.weight[0]], [10 / 3, (128 / 9) ** -0.5])


@pytest.mark.parametrize("seed", range(5))
def test_without_memory_it_is_k_means_from_the_last_centres(seed: int):
    random = np.random.default_rng(seed)
    earlier, delta, told = random.normal(1, 3, (200, 2)), random.normal(size=(300, 2)), random.uniform(-1, 1, 300)
    last = IBEMapping(5, random_state=0).fit(earlier, np.ones(200)).mapping_
    learnt = IBEMapping(5, last=last, random_state=0).fit(delta, told).mapping_
    scale = delta.std(axis=0)
    plain = KMeans(5, init=(last.centre_changes() - delta.mean(axis=0)) / scale, n_init=1)
    expected = plain.fit((delta - delta.mean(axis=0)) / scale).cluster_centers_ * scale + delta.mean(axis=0)
    found = learnt.centre_changes()
    np.testing.assert_allclose(found[np.argsort(found[:, 0])], expected[np.argsort(expected[:, 0])], atol=1e-6)


def test_evidence_fades_geometrically():
    """Four, six and two windows a refresh, half of the earlier ones remembered: n, n + n/2, n + n/2 + n/4, ..."""
    last, found = None, []
    for _ in range(6):
        last = fit(last=last, memory=0.5).mapping_
        found.append(last.evidence.tolist())
    for refresh, evidence in enumerate(found):
        np.testing.assert_allclose(evidence, np.array([4, 6, 2]) * (2 - 0.5**refresh))


def test_what_was_told_long_ago_fades_with_it():
    """A cluster was told -1 once and 0 ever since; at one half its mean goes from -1 over -1/3 and -1/7 to 0."""
    delta, last, found = np.repeat([-4.0, 4.0], 8)[:, None], None, []
    for told in (-1.0, 0.0, 0.0, 0.0):
        told_all = np.repeat([told, 1.0], 8)
        last = IBEMapping(2, last=last, memory=0.5, random_state=0).fit(delta, told_all).mapping_
        found.append(last.mean_instructions[0, 0])
    np.testing.assert_allclose(found, [-1, -1 / 3, -1 / 7, -1 / 15])


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.99])
def test_the_same_windows_again_leave_everything_where_it_was(memory: float):
    once = fit().mapping_
    twice = fit(last=once, memory=memory).mapping_
    for name in set(once.__dataclass_fields__) - {"evidence"}:
        np.testing.assert_allclose(getattr(twice, name), getattr(once, name), atol=1e-9, err_msg=name)
    np.testing.assert_allclose(twice.evidence, once.evidence * (1 + memory))


def test_clusters_that_became_one_remember_together():
    """Those at 3 and 5 end up in one; the third goes where the new windows are."""
    last = on_a_line([-4, 3, 5], [-1, 0, 1], evidence=[10, 10, 20])
    delta, told = np.repeat([-4.0, 3.5, 20.0], 100)[:, None], np.repeat([-1.0, 0.5, 1.0], 100)
    mapping = IBEMapping(3, last=last, memory=0.1, random_state=0).fit(delta, told).mapping_
    np.testing.assert_allclose(mapping.evidence, [101, 103, 100])
    np.testing.assert_allclose(mapping.centre_changes()[:, 0], [-4, (350 + 3 + 2 * 5) / 103, 20])
    np.testing.assert_allclose(mapping.mean_instructions[:, 0], [-1, (50 + 0 + 2 * 1) / 103, 1])


def test_a_cluster_without_a_new_window_lives_on_what_is_remembered():
    last = on_a_line([-4, 0, 30], [-1, 0, 0.5], evidence=[10, 10, 10])
    delta, told = np.array([[-4.0], [-4.1], [0.0], [0.1]]), np.array([-1.0, -1, 1, 1])
    mapping = IBEMapping(3, last=last, memory=0.9, random_state=0).fit(delta, told).mapping_
    assert mapping.sizes.tolist() == [2, 2, 0]
    assert mapping.evidence.tolist() == [11, 11, 9]
    np.testing.assert_allclose(mapping.mean_instructions, [[-1], [2 / 11], [0.5]])
    assert mapping.purities.tolist() == [1, 1, 0]


def test_windows_that_are_drawn_stand_for_all_of_them_against_memory():
    """2,000 new windows each side, half of them clustered, against 2,000 remembered: the centre is in the middle."""
    last = on_a_line([-4, 4], evidence=[4_000, 4_000])
    delta = np.repeat([-2.0, 6.0], 2_000)[:, None]
    settings = {"last": last, "memory": 0.5, "max_fit_windows": 2_000, "random_state": 0}
    mapping = IBEMapping(2, **settings).fit(delta, np.repeat([-1.0, 1.0], 2_000)).mapping_
    np.testing.assert_allclose(mapping.centre_changes(), [[-3], [5]], atol=0.05)
    assert mapping.evidence.tolist() == [4_000, 4_000]


def test_a_dimension_left_out_stays_left_out():
    once = fit(n_clusters=2, dimensions=[0]).mapping_
    twice = fit(n_clusters=2, dimensions=[0], last=once, memory=0.75).mapping_
    assert (twice.weight > 0).tolist() == [True, False]
    np.testing.assert_allclose(twice.weight, once.weight)
    np.testing.assert_allclose(twice.mean, once.mean)


def test_a_new_mapping_numbers_its_clusters_and_stands_on_its_windows(mapping: ClusterMapping):
    assert mapping.ids.tolist() == [0, 1, 2]
    assert mapping.ids.dtype.kind == "i"
    assert mapping.evidence.tolist() == mapping.sizes.tolist() == [4, 6, 2]


@pytest.mark.parametrize("memory", [-0.01, 1.0, 2.0, float("nan")])
def test_a_memory_outside_its_limits_is_refused(memory: float):
    with pytest.raises(ValueError, match=f"memory={memory}: at least 0 and below 1"):
        fit(memory=memory)


def test_centres_are_told_as_changes_of_the_state():
    mapping = fit(dimensions=[0]).mapping_
    np.testing.assert_allclose(mapping.centre_changes()[:, 0], [-3, 0, 3], atol=0.1)
    np.testing.assert_allclose(mapping.centre_changes()[:, 1], groups()[0][:, 1].mean())


def test_a_last_vocabulary_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"last has shape \(2, 2\), expected \(3, 2\)"):
        fit(last=fit(n_clusters=2).mapping_)
    for dimensions in (1, 3):  # numpy would stretch one to all, and refuse three in words of its own
        delta = np.random.default_rng(0).normal(size=(20, dimensions))
        last = IBEMapping(3, random_state=0).fit(delta, np.zeros(20)).mapping_
        with pytest.raises(ValueError, match=rf"last has shape \(3, {dimensions}\), expected \(3, 2\)"):
            fit(last=last)


def test_fewer_distinct_windows_than_clusters_are_too_little():
    with pytest.raises(TooLittleDataError, match="2 distinct windows for n_clusters=3"):
        IBEMapping(3).fit(np.array([LEFT, RIGHT] * 10), np.zeros(20))
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


def test_a_mapping_survives_json(mapping: ClusterMapping):
    again = ClusterMapping.from_dict(json.loads(json.dumps(mapping.to_dict())))
    for name in mapping.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(again, name), getattr(mapping, name))
        assert getattr(again, name).dtype == getattr(mapping, name).dtype


@pytest.mark.parametrize("name", ClusterMapping.__dataclass_fields__)
def test_a_damaged_mapping_is_refused(mapping: ClusterMapping, name: str):
    values = mapping.to_dict()
    with pytest.raises(ValueError, match=name if name != "centres" else "shape"):
        ClusterMapping.from_dict(values | {name: values[name][:-1]})
    with pytest.raises(ValueError, match=f"the mapping lacks '{name}'"):
        ClusterMapping.from_dict({key: value for key, value in values.items() if key != name})


def test_a_mapping_cannot_be_changed(mapping: ClusterMapping):
    with pytest.raises(ValueError, match="read-only"):
        mapping.expressions[0] = 0
