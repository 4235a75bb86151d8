"""Words, votes and what came true, counted by hand."""

import numpy as np
from by_hand import WORDS
from lift import moments, words

from ibe_rl.evaluation.spoken import calibrate, speak

UP, DOWN, STAY = "going up", "going down", "staying"
HERE = moments(
    realised=[2, -2, 0, 2],
    predicted=[[2, 2, 2], [2, -2, -2], [0, 2, -2], [-2, 0, 0]],
    told=[1, -1, 0, 1],
    episode=[0, 0, 1, 1],
)


def test_the_first_future_is_put_into_words_and_the_others_vote():
    spoken = speak(words(), HERE, 5, [WORDS])
    assert spoken.phrase.tolist() == [UP, UP, STAY, DOWN]
    assert spoken.expression[:, 0].tolist() == [1, 1, 0, -1]
    assert spoken.true.tolist() == [True, False, True, False]
    assert spoken.voted_true.tolist() == [True, True, True, False]  # of equally frequent ones the first one said
    np.testing.assert_allclose(spoken.agreement, [1, 1 / 3, 1 / 3, 1 / 3])
    np.testing.assert_allclose(spoken.purity, [1, 1, 0.75, 0.5])
    np.testing.assert_allclose(spoken.features[:, 1], spoken.purity)


def test_one_future_votes_for_itself():
    spoken = speak(words(), HERE.first_future(), 5, [WORDS])
    assert spoken.voted_true.tolist() == spoken.true.tolist()
    assert spoken.agreement.tolist() == [1, 1, 1, 1]


def test_who_agrees_with_itself_may_be_surer():
    count = 200
    sure = np.arange(count) % 2 == 0
    futures = np.where(sure[:, None], [[2, 2]], [[2, -2]])
    here = moments(np.where(sure, 2, -2), futures, told=[0] * count, episode=np.arange(count))
    spoken = speak(words(), here, 5, [WORDS])
    probability = calibrate(spoken).probability(spoken.features)
    assert probability[sure].min() > 0.9
    assert probability[~sure].max() < 0.1
