"""Nine groups of changes for two numbers, left or right and down or up: each stage of the mapping, answers known."""

from typing import Any

import numpy as np
import pytest
from sklearn.metrics import pairwise_distances

from ibe_rl.ibe import IBEMapping, keep_identity, phrase
from ibe_rl.ibe.space import consequences, rule_axes
from ibe_rl.metrics.drift import vocabulary_drift
from ibe_rl.task import Phrases
from ibe_rl.types import Array

WAYS = np.array([[a, b] for a in (-1.0, 0, 1) for b in (-1.0, 0, 1)])
"""What is told."""
MOVES = WAYS * [3, 2]
"""How far it then moves in the first and in the second dimension; a third one never does."""
EACH = 8
WORDS = (
    Phrases("straight", "{degree}left", "{degree}right", ((0.2, "slightly "), (0.6, ""))),
    Phrases("level", "{degree}down", "{degree}up", ((0.2, "slightly "), (0.6, ""))),
)


def groups() -> tuple[Array, Array]:
    """Changes ``(72, 3)`` and what was told; in each group one window in eight was told to go nowhere."""
    near = np.random.default_rng(0).normal(0, 0.01, (len(WAYS) * EACH, 2))
    delta = np.column_stack([np.repeat(MOVES, EACH, axis=0) + near, np.zeros(len(near))])
    instruction = np.repeat(WAYS, EACH, axis=0)
    instruction[::EACH] = 0
    return delta, instruction


def heard() -> tuple[Array, Array]:
    """Told by where it is: to come nearer to the middle of the first two dimensions."""
    states = np.random.default_rng(1).uniform(-2, 2, (2_000, 3))
    return states, np.where(np.abs(states[:, :2]) > 0.7, -np.sign(states[:, :2]), 0)


def fit(**settings: Any) -> IBEMapping:
    asked = {"n_clusters": 9, "random_state": 0} | settings
    return IBEMapping(**asked).fit(*groups(), *(heard() if asked.get("space") == "rule" else ()))


AXIS = {"space": "rule", "power": 1 / 3, "normalisation": "movement"}


@pytest.mark.parametrize("settings", [{}, {"normalisation": "sign"}, AXIS, AXIS | {"symmetric": True}])
def test_every_combination_gets_a_cluster_and_its_name(settings: dict[str, Any]):
    mapping = fit(**settings).mapping_
    order = np.lexsort(mapping.expressions.round(1).T[::-1])
    np.testing.assert_allclose(mapping.expressions[order], WAYS, atol=0.02)
    np.testing.assert_allclose(mapping.mean_instructions[order], WAYS * 7 / 8)
    assert np.all(np.diff(mapping.expressions[:, 0]) >= 0)
    assert mapping.sizes.tolist() == [EACH] * 9
    assert [phrase(one, WORDS) for one in mapping.expressions[order][[0, 4, 5]]] == [
        "left and down",
        "straight and level",
        "straight and up",
    ]


def test_purity_is_of_the_instructions_in_both_numbers_at_once():
    assert fit().mapping_.purities.tolist() == [7 / 8] * 4 + [1] + [7 / 8] * 4


def test_the_axes_are_those_on_which_the_words_turn():
    axes = rule_axes(*heard(), seed=0)
    assert np.argmax(np.abs(axes), axis=0).tolist() == [0, 1]
    assert (axes != 0).sum(axis=0).tolist() == [1, 1]
    weights = fit(**AXIS).mapping_.space.weights[0]
    np.testing.assert_allclose(weights, [[1 / 3, 0], [0, 1 / 2], [0, 0]], atol=0.01)  # 1 is what 1 brought about


def test_a_dimension_that_moves_one_way_whatever_is_said_is_left_out():
    """The second number depends on a third dimension too, which always falls, less if instructed to rise."""
    delta, instruction = groups()
    axes = np.array([[1.0, 0], [0, -1], [0.5, -1]])
    np.testing.assert_array_equal(
        consequences(axes, delta, instruction), axes
    )  # what does not move at all is no matter
    delta[:, 2] = instruction[:, 1] - 5
    np.testing.assert_array_equal(consequences(axes, delta, instruction), [[1, 0], [0, -1], [0, 0]])


def test_an_axis_on_which_nothing_moves_both_ways_stays():
    delta, instruction = groups()
    axes = np.array([[1.0, 0], [0, -1], [0, 0]])
    np.testing.assert_array_equal(consequences(axes, np.abs(delta), instruction), axes)
    np.testing.assert_array_equal(consequences(axes, delta, np.abs(instruction)), axes)


def test_centres_are_their_own_mirror_image_in_both_numbers_at_once():
    mapping = fit(**AXIS, n_clusters=6, symmetric=True).mapping_
    apart = pairwise_distances(mapping.expressions, -mapping.expressions).min(axis=1)
    assert apart == pytest.approx(np.zeros(6), abs=1e-6)
    for column in mapping.expressions.T.round(6):
        assert np.sum(column < 0) == np.sum(column > 0)


def test_clusters_are_known_again_and_what_moved_in_either_number_is_seen():
    delta, instruction = groups()
    before = fit().mapping_
    after = IBEMapping(9, random_state=3).fit(delta, instruction * [1, -1]).mapping_  # up and down have changed places
    named, transition = keep_identity(before, after, delta, next_id=9)
    assert sorted(transition.survived) == list(range(9))
    where = {int(name): row for row, name in enumerate(named.ids)}
    for name, expression in enumerate(before.expressions):
        np.testing.assert_allclose(named.expressions[where[name]], expression * [1, -1], atol=0.02)
    drift = vocabulary_drift(before, named, delta, WORDS)
    assert drift.phrase_changed == pytest.approx(6 / 9)
    assert drift.expression_moved == pytest.approx(2 * 6 / 9, abs=0.02)
    assert drift.cluster_agreement == 1
