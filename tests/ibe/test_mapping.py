"""Clusters made by hand: what a change is called, and how a mapping is kept."""

import json
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from by_hand import column, on_a_line
from groups import DOWN, LEFT, RIGHT, fit, groups

from ibe_rl.ibe import ClusterMapping
from ibe_rl.ibe.mapping import MEMBERSHIPS, mean_movements
from ibe_rl.ibe.space import along
from ibe_rl.types import ExpressionMapping

ARRAYS = ("centres", "mean_instructions", "expressions", "sizes", "purities", "evidence", "ids")


@pytest.fixture
def mapping() -> ClusterMapping:
    return fit().mapping_


def test_any_change_is_given_to_the_nearest_centre(mapping: ClusterMapping):
    new = np.array([LEFT, DOWN, RIGHT, [9.0, 1.0]])
    assert mapping.cluster(new).tolist() == [0, 1, 2, 2]
    np.testing.assert_allclose(mapping.express(new), mapping.expressions[[0, 1, 2, 2]])
    np.testing.assert_allclose(mapping.confidence(new), mapping.purities[[0, 1, 2, 2]])


def test_a_soft_cluster_is_called_by_its_neighbours_too():
    """Half way between two clusters it is their mean; at one of them the other, two widths off, counts e^-2."""
    soft = replace(on_a_line([-1, 1], [-1, 1]), membership="soft", width=1.0)
    expected = (1 - np.exp(-2)) / (1 + np.exp(-2))
    np.testing.assert_allclose(soft.express(column(0, 1, -1))[:, 0], [0, expected, -expected], atol=1e-12)
    narrow = replace(soft, width=0.01)
    np.testing.assert_allclose(narrow.express(column(-0.5, 0.5, 9))[:, 0], [-1, 1, 1])
    wide = replace(soft, width=100.0)
    np.testing.assert_allclose(wide.express(column(-1, 1))[:, 0], [0, 0], atol=1e-3)


def test_soft_expressions_rise_without_steps():
    soft = replace(on_a_line([-2, -1, 0, 1, 2]), membership="soft", width=1.0)
    hard = replace(soft, membership="hard")
    line = column(*np.linspace(-3, 3, 301))
    said = soft.express(line)[:, 0]
    assert (np.diff(said) > 0).all()
    assert np.diff(said).max() < 0.02
    assert len(np.unique(hard.express(line))) == 5
    np.testing.assert_array_equal(soft.cluster(line), hard.cluster(line))


def along_the_first(power: float = 1.0) -> ClusterMapping:
    """Two numbers, of which the first counts, halved; directly expressed."""
    one = on_a_line([-1, 1])
    return replace(one, space=along(np.array([[0.5], [0.0]]), power), membership="direct")


@pytest.mark.parametrize("power", [1.0, 1 / 3])
def test_a_direct_expression_is_the_place_itself_up_to_its_limits(power: float):
    delta = np.array([[0.0, 9.0], [1.0, -9.0], [-0.5, 0.0], [2.0, 1.0], [7.0, 1.0], [-7.0, 1.0]])
    np.testing.assert_allclose(along_the_first(power).express(delta)[:, 0], [0, 0.5, -0.25, 1, 1, -1], atol=1e-12)
    assert along_the_first(power).cluster(delta[1:3]).tolist() == [1, 0]


def test_a_graded_mapping_has_the_words_of_its_clusters_and_the_number_of_the_place():
    delta = np.array([[0.2, 9.0], [1.0, -9.0], [-0.5, 0.0], [7.0, 1.0]])
    graded = replace(along_the_first(), membership="graded")
    assert graded.express(delta)[:, 0].tolist() == replace(graded, membership="hard").express(delta)[:, 0].tolist()
    np.testing.assert_allclose(graded.movement(delta)[:, 0], [0.1, 0.5, -0.25, 1])
    for membership in ("hard", "soft", "direct"):
        other = replace(graded, membership=membership)
        np.testing.assert_array_equal(other.movement(delta), other.express(delta))


def test_the_mean_movement_is_over_the_futures_of_a_moment():
    futures = np.array([[[0.2, 0.0], [1.0, 0.0]], [[-8.0, 0.0], [2.0, 0.0]]])
    graded = replace(along_the_first(), membership="graded")
    np.testing.assert_allclose(mean_movements(graded, futures)[:, 0], [0.3, 0])  # at most 1 each
    np.testing.assert_allclose(mean_movements(cast(ExpressionMapping, OnlyWords()), futures)[:, 0], [1, 0])


class OnlyWords:
    """A mapping of one's own, without movements."""

    def express(self, delta: np.ndarray) -> np.ndarray:
        return np.sign(delta[:, :1])


def test_a_direct_expression_has_as_many_numbers_as_the_space():
    with pytest.raises(ValueError, match=r"expressions has shape \(2, 2\), expected \(2, 1\)"):
        replace(along_the_first(), expressions=np.zeros((2, 2)))


@pytest.mark.parametrize("wrong", [{"membership": "loose"}, {"width": 0.0}, {"width": -1.0}, {"width": float("nan")}])
def test_a_membership_that_is_none_is_refused(wrong: dict[str, Any]):
    with pytest.raises(ValueError, match=r"membership '\w+' of width .*: choose hard, soft, direct"):
        replace(on_a_line([0, 1]), **wrong)


def test_centres_are_given_as_changes_of_the_state():
    mapping = fit(dimensions=[0]).mapping_
    np.testing.assert_allclose(mapping.centre_changes()[:, 0], [-3, 0, 3], atol=0.1)
    np.testing.assert_allclose(mapping.centre_changes()[:, 1], groups()[0][:, 1].mean())


@pytest.mark.parametrize("membership", MEMBERSHIPS)
def test_a_mapping_survives_json(membership: str):
    mapping = replace(along_the_first(1 / 3), membership=membership, width=0.7)
    again = ClusterMapping.from_dict(json.loads(json.dumps(mapping.to_dict())))
    assert again.to_dict() == mapping.to_dict()
    assert (again.membership, again.width) == (membership, 0.7)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(mapping, name))
        assert getattr(again, name).dtype == getattr(mapping, name).dtype
    delta = np.random.default_rng(0).normal(size=(20, 2))
    np.testing.assert_array_equal(again.express(delta), mapping.express(delta))


@pytest.mark.parametrize("name", [*ARRAYS, "space", "membership", "width"])
def test_a_mapping_that_lacks_something_is_refused(mapping: ClusterMapping, name: str):
    values = mapping.to_dict()
    with pytest.raises(ValueError, match=f"the mapping lacks '{name}'"):
        ClusterMapping.from_dict({key: value for key, value in values.items() if key != name})


@pytest.mark.parametrize("name", ARRAYS)
def test_a_mapping_that_was_cut_is_refused(mapping: ClusterMapping, name: str):
    values = mapping.to_dict()
    with pytest.raises(ValueError, match=name if name != "centres" else "shape"):
        ClusterMapping.from_dict(values | {name: values[name][:-1]})


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("space", [], "the space is damaged"),
        ("space", {}, "the space is damaged: 'layers'"),
        ("membership", "loose", "choose hard, soft, direct"),
        ("width", 0, "choose hard, soft, direct"),
        ("width", None, "the mapping is damaged"),
        ("centres", [[0.0]], "centres has shape|shape"),
        ("sizes", "many", "could not convert"),
    ],
)
def test_a_damaged_mapping_is_refused(mapping: ClusterMapping, name: str, value: Any, message: str):
    with pytest.raises(ValueError, match=message):
        ClusterMapping.from_dict(mapping.to_dict() | {name: value})


def test_a_mapping_cannot_be_changed(mapping: ClusterMapping):
    with pytest.raises(ValueError, match="read-only"):
        mapping.expressions[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        mapping.space.weights[0][0] = 0
