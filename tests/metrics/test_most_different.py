"""Which rows stand for all: worked out on a line."""

import numpy as np

from ibe_rl.metrics.most_different import most_different


def test_the_typical_one_comes_first_then_whatever_is_farthest_from_the_chosen():
    places = np.array([[0.0], [4.0], [5.0], [6.0], [10.0]])
    assert most_different(places, 3) == [2, 0, 4]  # both ends are 5 away from it; the first of equals
    assert most_different(places, 4) == [2, 0, 4, 1]


def test_there_are_no_more_than_differ():
    assert most_different(np.array([[1.0], [1.0], [2.0]]), 5) == [0, 2]
    assert most_different(np.ones((3, 2)), 5) == [0]
