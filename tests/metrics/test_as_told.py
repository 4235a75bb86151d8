"""Whether an agent does as told, on cases that can be read off."""

from dataclasses import replace

import numpy as np
from by_hand import TASK, on_a_line, plain

from ibe_rl.ibe import ClusterMapping
from ibe_rl.metrics.as_told import not_as_told, ways_gone, ways_said, ways_told
from ibe_rl.task.words import Words

IN_WORDS = replace(TASK, phrases=Words(["left", "hold", "right"]))


def test_numbers_ask_for_a_direction_and_the_band_decides_what_went():
    told = ways_told(np.array([[-0.5], [0.0], [1.0]]), TASK)
    np.testing.assert_array_equal(told, [[-1], [0], [1]])
    changes = np.zeros((3, 3))
    changes[:, 0] = [-0.6, 0.4, -0.6]
    went = ways_gone(changes, on_a_line([0.0]), TASK)
    np.testing.assert_array_equal(went, [[-1], [0], [-1]])
    np.testing.assert_array_equal(not_as_told(told, went, np.array([True, True, True])), [0, 0, 1])
    np.testing.assert_array_equal(not_as_told(told, went, np.array([True, False, False])), [0, np.nan, np.nan])


def test_what_is_said_has_a_direction_from_the_first_degree_on():
    np.testing.assert_array_equal(ways_said(np.array([[-0.3], [-0.29], [0.0], [0.9]]), TASK), [[-1], [0], [0], [1]])


def test_one_of_several_numbers_is_enough():
    told, went = np.array([[1, 0], [1, 0]]), np.array([[1, 0], [1, 1]])
    np.testing.assert_array_equal(not_as_told(told, went, np.ones(2, bool)), [0, 1])


def test_words_are_compared_as_words():
    shares = np.array([[0.8, 0.1, 0.1], [0.1, 0.1, 0.8]])
    mapping = ClusterMapping(
        plain(1), np.array([[-1.0], [1.0]]), shares, shares, np.ones(2), np.ones(2), np.ones(2), np.arange(2)
    )
    told = ways_told(np.array([[1, 0, 0], [0, 1, 0]]), IN_WORDS)
    went = ways_gone(np.array([[-2.0], [2.0]]), mapping, IN_WORDS)
    np.testing.assert_array_equal(told, [[0], [1]])
    np.testing.assert_array_equal(went, [[0], [2]])
    np.testing.assert_array_equal(ways_said(shares, IN_WORDS), [[0], [2]])
