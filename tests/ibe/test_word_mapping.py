"""Words without an order, of an instructor whose rule is known: each is spoken for the movement that it goes with."""

import numpy as np
import pytest

from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.ibe.vocabulary import in_own_words
from ibe_rl.ibe.word_mapping import fit_words
from ibe_rl.ibe.word_meaning import asked_motion, auc_of, balanced_shares, expected_motion, top_words
from ibe_rl.task.words import Words
from ibe_rl.types import Array

LEFT, RIGHT, HOLD, SLOWER = range(4)
EPISODES, STEPS = 60, 40
WAYS = np.array([[-1.0, 0, 0], [1.0, 0, 0], [0, 0, 0], [0, 1.0, 0]])
"""Where each word leads: x, speed, and a dimension that means nothing."""


def lessons(seed: int = 0, words: Array | None = None, slots: int = 4) -> tuple[Windows, Array, Array]:
    """Windows, and the states and instructions that they begin with; ``words`` are the slots of the four."""
    random = np.random.default_rng(seed)
    states = random.uniform(-1, 1, (EPISODES * STEPS, 3))
    aside, fast = np.abs(states[:, 0]) > 0.4, states[:, 1] < -0.4
    said = np.where(aside, np.where(states[:, 0] > 0, LEFT, RIGHT), np.where(fast, SLOWER, HOLD))
    delta = WAYS[said] * 0.5 + random.normal(0, 0.15, states.shape) - [0, 0, 0.3]  # it falls, whatever is said
    instruction = np.eye(slots)[said if words is None else words[said]]
    episode = np.repeat(np.arange(EPISODES), STEPS)
    step = np.tile(np.arange(STEPS), EPISODES)
    return Windows(delta, instruction, np.ones(len(delta), bool), episode, step, 5), states, instruction


def learnt(*of: tuple[Windows, Array, Array]) -> ClusterMapping:
    windows, states, instructions = of[0] if of else lessons()
    return fit_words(windows, states, instructions, clusters_per_axis=8, kept=np.ones(3, bool))


def spoken(mapping: ClusterMapping, moves: Array) -> list[int]:
    found: list[int] = top_words(mapping.express(moves - np.array([0, 0, 0.3]))).tolist()
    return found


def test_each_word_is_spoken_for_its_movement():
    mapping = learnt()
    assert spoken(mapping, 0.5 * WAYS) == [LEFT, RIGHT, HOLD, SLOWER]
    assert all(one.known for one in mapping.meanings)
    np.testing.assert_allclose(mapping.expressions.sum(axis=1), 1)
    assert not mapping.space.weights[0][2].any()  # what falls whatever is said is no consequence


def test_words_of_another_order_are_spoken_as_they_were_used():
    swapped = np.array([1, 0, 3, 2])
    assert spoken(learnt(lessons(words=swapped, slots=6)), 0.5 * WAYS) == swapped.tolist()


def test_a_listener_expects_the_movement_that_went_with_the_words():
    mapping = learnt(lessons(words=np.array([1, 0, 2, 3])))  # keys for left and right are swapped
    said = mapping.express(0.5 * WAYS - np.array([0, 0, 0.3]))
    expected = expected_motion(mapping, said, (0, 1))
    assert (expected[LEFT, 0] < -0.8, expected[RIGHT, 0] > 0.8, expected[SLOWER, 1] > 0.8) == (True, True, True)
    asked = asked_motion(mapping, np.eye(4), (0, 1), (0.1, 0.1))
    np.testing.assert_array_equal(asked, [[1, 0], [-1, 0], [0, 0], [0, 1]])
    numbers = np.ones((2, 1))
    assert expected_motion(None, numbers, (0,)) is numbers
    assert asked_motion(None, numbers, (0,), (0.1,)) is numbers


def test_words_that_are_used_alike_are_spoken_as_one():
    windows, states, instructions = lessons(slots=5)
    random = np.random.default_rng(1)
    both = (instructions[:, LEFT] > 0) & (random.random(len(states)) < 0.3)
    twins = np.where(both[:, None], np.eye(5)[4], instructions)
    mapping = learnt((Windows(windows.delta, twins, windows.given, windows.episode, windows.step, 5), states, twins))
    assert mapping.meanings[4].same_as == LEFT
    assert [one.same_as for one in mapping.meanings[:4]] == [None] * 4
    assert not mapping.expressions[:, 4].any()
    assert spoken(mapping, 0.5 * WAYS) == [LEFT, RIGHT, HOLD, SLOWER]


def test_a_word_without_information_or_hardly_heard_means_nothing_yet():
    windows, states, instructions = lessons(slots=6)
    random = np.random.default_rng(2)
    said = instructions.argmax(axis=1)
    said = np.where(random.random(len(said)) < 0.2, 4, said)  # at any time
    said[:3] = 5
    noisy = np.eye(6)[said]
    mapping = learnt((Windows(windows.delta, noisy, windows.given, windows.episode, windows.step, 5), states, noisy))
    assert [one.known for one in mapping.meanings] == [True] * 4 + [False] * 2
    assert mapping.meanings[5].reason == "heard at 3 steps, too few"
    assert not mapping.expressions[:, 4:].any()
    assert mapping.knows(windows.delta).all()


def test_a_vocabulary_of_words_survives_its_file():
    mapping = learnt()
    again = ClusterMapping.from_dict(mapping.to_dict())
    assert again.meanings == mapping.meanings
    np.testing.assert_array_equal(again.expressions, mapping.expressions)


def test_words_that_follow_no_state_are_told_apart_by_the_movement():
    windows, states, instructions = lessons()
    elsewhere = np.random.default_rng(3).permutation(states)
    mapping = learnt((windows, elsewhere, instructions))
    assert spoken(mapping, 0.5 * WAYS) == [LEFT, RIGHT, HOLD, SLOWER]


def test_one_word_alone_cannot_be_told_apart():
    windows, states, instructions = lessons()
    only = np.eye(4)[np.zeros(len(instructions), int)]
    with pytest.raises(TooLittleDataError, match="fewer than two words"):
        learnt((Windows(windows.delta, only, windows.given, windows.episode, windows.step, 5), states, only))


@pytest.mark.parametrize("kept", [np.zeros(3, bool)])
def test_words_about_dimensions_that_do_not_count_give_no_vocabulary(kept: Array):
    windows, states, instructions = lessons()
    with pytest.raises(TooLittleDataError, match="no movement goes with the words"):
        fit_words(windows, states, instructions, clusters_per_axis=8, kept=kept)


def test_shares_count_rare_words_as_much_as_frequent_ones():
    labels, said = np.array([0, 0, 0, 0, 1, 1]), np.array([0, 0, 0, 1, 0, 2])
    shares = balanced_shares(labels, said, 3, 4)
    np.testing.assert_allclose(shares[0], [0.75 / 1.75, 1 / 1.75, 0, 0])
    np.testing.assert_allclose(shares[2], [1 / 3, 1 / 3, 1 / 3, 0])  # nothing is known of it


def test_auc_counts_pairs():
    assert auc_of(np.array([0.1, 0.4, 0.35, 0.8]), np.array([False, False, True, True])) == 0.75
    assert auc_of(np.zeros(3), np.ones(3, bool)) == 0.5


@pytest.mark.parametrize(
    ("shares", "phrase"),
    [
        ([0.9, 0.1, 0.0], "links"),
        ([0.6, 0.3, 0.1], "a little 'links'"),
        ([0.4, 0.5, 0.1], "between 'links' and 'halt'"),
        ([0.3, 0.4, 0.3], "between 'links', 'halt' and '上'"),
        ([0.0, 0.0, 1.0], "上"),
        ([0.0, 0.0, 0.0], "no word for it"),
    ],
)
def test_shares_become_degrees_and_mixtures(shares: list[float], phrase: str):
    assert in_own_words(np.array([*shares, 0.0]), Words(["links", "halt", "上"], 4)) == phrase
