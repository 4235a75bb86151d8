"""Words, votes and what came true, counted by hand."""

import numpy as np
from by_hand import WORDS
from lift import moments, words

from ibe_rl.evaluation.verbalise import calibrate, speak

UP, DOWN, STAY = "going up", "going down", "staying"
HERE = moments(
    realised=[2, -2, 0, 2],
    predicted=[[2, 2, 2], [2, -2, -2], [0, 2, -2], [-2, 0, 0]],
    instruction=[1, -1, 0, 1],
    episode=[0, 0, 1, 1],
)


def test_the_futures_vote_for_the_words_and_their_mean_is_the_number():
    spoken = speak(words(), HERE, 5, [WORDS])
    np.testing.assert_allclose(spoken.expression[:, 0], [1, -1 / 3, 0, -1 / 3])
    assert spoken.true.tolist() == [True, False, True, False]
    assert spoken.phrase.tolist() == [UP, DOWN, STAY, STAY]  # of equally frequent ones the first one is said
    assert spoken.which.tolist() == [0, 1, 0, 1]
    assert spoken.said[:, 0].tolist() == [1, -1, 0, 0]
    assert spoken.voted_true.tolist() == [True, True, True, False]
    np.testing.assert_allclose(spoken.agreement, [1, 2 / 3, 1 / 3, 2 / 3])
    np.testing.assert_allclose(spoken.purity, [1, 0.5, 0.75, 0.75])  # of what is said
    np.testing.assert_allclose(spoken.features, np.column_stack([spoken.agreement, spoken.purity]))


def test_who_agrees_on_a_phrase_may_mean_different_movements():
    """What is said is the first of the futures that are called so, not their mean."""
    small = words((-2, 0, 1, 2), (-1, 0, 0.8, 1))
    spoken = speak(small, moments([2], [[-2, 1, 2]], instruction=[0], episode=[0]), 5, [WORDS])
    assert (spoken.phrase.tolist(), spoken.which.tolist(), spoken.said.tolist()) == ([UP], [1], [[0.8]])
    assert (spoken.true.tolist(), spoken.voted_true.tolist()) == ([False], [True])


def test_one_future_votes_for_itself():
    spoken = speak(words(), HERE.first_future(), 5, [WORDS])
    assert spoken.phrase.tolist() == [UP, UP, STAY, DOWN]
    assert spoken.which.tolist() == [0, 0, 0, 0]
    np.testing.assert_array_equal(spoken.said, spoken.expression)
    assert spoken.voted_true.tolist() == spoken.true.tolist()
    assert spoken.agreement.tolist() == [1, 1, 1, 1]


def test_who_agrees_with_itself_may_be_surer():
    count = 200
    sure = np.arange(count) % 2 == 0
    futures = np.where(sure[:, None], [[2, 2]], [[2, -2]])
    here = moments(np.where(sure, 2, -2), futures, instruction=[0] * count, episode=np.arange(count))
    spoken = speak(words(), here, 5, [WORDS])
    probability = calibrate(spoken).probability(spoken.features)
    assert probability[sure].min() > 0.9
    assert probability[~sure].max() < 0.1
