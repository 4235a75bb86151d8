"""What moved, on windows and in states counted by hand."""

from dataclasses import replace

import numpy as np
import pytest
from by_hand import WORDS, column, on_a_line, plain

from ibe_rl.ibe import ClusterMapping
from ibe_rl.metrics.drift import VocabularyDrift, policy_drift, vocabulary_drift
from ibe_rl.task import Phrases

PROBE = column(-9, -8, -7, -1, 0, 0.5, 1, 8, 9, 10)
"""Three windows of the cluster at -10, four of the one at 0, three of the one at 10."""
DOWN_STAY_UP = on_a_line([-10, 0, 10], [-1, 0, 1])


def drift(before: ClusterMapping, after: ClusterMapping) -> VocabularyDrift:
    return vocabulary_drift(before, after, PROBE, [WORDS])


def test_nothing_moved_between_a_vocabulary_and_itself():
    assert drift(DOWN_STAY_UP, DOWN_STAY_UP) == VocabularyDrift(0.0, 0.0, 1.0)


def test_other_numbers_for_the_same_clusters_are_no_drift():
    assert drift(DOWN_STAY_UP, on_a_line([10, -10, 0], [1, -1, 0], ids=[7, 8, 9])) == VocabularyDrift(0.0, 0.0, 1.0)


def test_a_phrase_that_flipped_counts_with_its_windows():
    assert drift(DOWN_STAY_UP, on_a_line([-10, 0, 10], [1, 0, 1])) == VocabularyDrift(0.3, 0.3 * 2, 1.0)
    assert drift(DOWN_STAY_UP, on_a_line([-10, 0, 10], [-1, 1, 1])) == VocabularyDrift(0.4, 0.4 * 1, 1.0)


def test_an_expression_may_move_within_its_phrase():
    moved = drift(DOWN_STAY_UP, on_a_line([-10, 0, 10], [-0.75, 0.25, 1]))  # "going down" is -0.7 and below
    assert moved == VocabularyDrift(0.0, pytest.approx(0.7 * 0.25), 1.0)
    moved = drift(DOWN_STAY_UP, on_a_line([-10, 0, 10], [-0.5, 0, 1]))  # "going a little down"
    assert moved == VocabularyDrift(0.3, pytest.approx(0.3 * 0.5), 1.0)


def test_clusters_may_move_under_the_same_words():
    """Pairs (-, -), (-, +), (+, -), (+, +) once each: the adjusted Rand index of two groupings at odds is -1/2."""
    probe = np.array([[-1.0, -1], [-1, 1], [1, -1], [1, 1]])
    across = replace(on_a_line([0, 0], [1, 1]), space=plain(2), centres=np.array([[-1, 0], [1, 0]]))
    along = replace(across, centres=np.array([[0, -1], [0, 1]]))
    assert vocabulary_drift(across, along, probe, [WORDS]) == VocabularyDrift(0.0, 0.0, pytest.approx(-0.5))


def test_expressions_of_several_numbers_are_compared_whole():
    def saying(first: float, second: float) -> ClusterMapping:
        two = np.array([[0, 0], [0, 0], [first, second]])
        return replace(DOWN_STAY_UP, expressions=two, mean_instructions=two)

    words = [WORDS, Phrases("there", "{degree}left", "{degree}right", ((0.5, ""),))]
    moved = vocabulary_drift(saying(0, 0), saying(0.3, 0.4), PROBE, words)  # "going a little up and there"
    assert moved == VocabularyDrift(0.3, pytest.approx(0.3 * 0.5), 1.0)


@pytest.mark.parametrize("seed", range(20))
def test_drift_has_no_direction_and_keeps_its_limits(seed: int):
    random = np.random.default_rng(seed)
    one, other = (on_a_line(random.normal(0, 8, k), random.uniform(-1, 1, k)) for k in random.integers(2, 6, 2))
    found = drift(one, other)
    assert found == drift(other, one)
    assert 0 <= found.phrase_changed <= 1
    assert 0 <= found.expression_moved <= 2
    assert -0.5 <= found.cluster_agreement <= 1


def test_policy_drift_is_the_share_of_other_actions():
    before = np.array([0, 1, 2, 3, 3, 2, 1, 0])
    after = np.array([0, 1, 2, 3, 3, 2, 0, 1])
    assert policy_drift(before, before) == 0
    assert policy_drift(before, after) == 0.25
    assert policy_drift(before, before + 1) == 1


def test_an_action_of_several_numbers_is_another_if_one_number_is():
    before = np.zeros((4, 3))
    after = np.array([[0, 0, 0], [0, 0.5, 0], [1, 1, 1], [0, 0, 0]])
    assert policy_drift(before, after) == 0.5
    assert policy_drift(before, before) == 0


def test_a_continuous_action_is_another_if_it_moved_by_a_tenth_of_what_it_varies_over():
    before = np.array([[0, 5], [10, 5], [5, 5], [5, 5]], np.float32)
    after = before + np.array([[0.9, 0], [0, 0], [-1.1, 0], [0, 1e-3]], np.float32)
    assert policy_drift(before, after) == 0.5  # the second number never varies by more than the thousandth
    assert policy_drift(before, before) == 0
