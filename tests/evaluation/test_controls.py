"""Controls are wrong in the way they are meant to be, and in no other."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from by_hand import column
from lift import heights, moments, words

from ibe_rl.evaluation.controls import Flipped, dealt, of_another_moment, random_clusters, shuffle_instructions
from ibe_rl.ibe import Windows
from ibe_rl.types import Episode

DELTA = heights(np.array([-3.0, -1, 0, 1, 3]))


def test_flipped_is_the_opposite_and_nothing_else():
    ours = words()
    flipped = Flipped(ours)
    np.testing.assert_array_equal(flipped.express(DELTA), -ours.express(DELTA))
    np.testing.assert_array_equal(flipped.cluster(DELTA), ours.cluster(DELTA))
    np.testing.assert_array_equal(flipped.confidence(DELTA), ours.confidence(DELTA))
    assert flipped.ids.tolist() == [0, 1, 2]
    for one in (ours, replace(ours, membership="graded")):
        np.testing.assert_array_equal(Flipped(one).movement(DELTA), -one.movement(DELTA))


def windows() -> Windows:
    change = np.repeat([-2.0, 0.0, 2.0], 4)
    ones = np.ones(12)
    return Windows(heights(change), np.sign(change)[:, None], ones.astype(bool), ones, ones, 5)


def test_random_clusters_are_windows_with_the_mean_of_the_instructions():
    [drawn] = random_clusters(windows(), 3, np.random.default_rng(0), 1)
    assert sorted(drawn.sizes.tolist()) == [4, 4, 4]
    assert sorted(drawn.ids.tolist()) == [0, 1, 2]
    np.testing.assert_allclose(drawn.express(heights(np.array([-2.1, 0.1, 1.9]))), column(-1, 0, 1))
    np.testing.assert_allclose(drawn.confidence(DELTA), 1)  # every cluster was told one thing only
    two = {tuple(one.centres[:, 0]) for one in random_clusters(windows(), 2, np.random.default_rng(0), 20)}
    assert len(two) > 3


def test_random_clusters_are_as_pure_as_the_instructions_in_them():
    """One cluster of four windows told down, four told nothing and four told up; its mean is nothing."""
    [one] = random_clusters(windows(), 1, np.random.default_rng(0), 1)
    assert (one.purities.tolist(), one.mean_instructions.tolist(), one.expressions.tolist()) == ([1 / 3], [[0]], [[0]])
    assert (one.sizes.tolist(), one.evidence.tolist(), one.ids.tolist()) == ([12], [12], [0])


@pytest.mark.parametrize("membership", ["hard", "soft"])
def test_names_are_dealt_out_again_and_the_clusters_stay(membership: str):
    ours, orders = replace(words(), membership=membership), set()
    for seed in range(30):
        others = dealt(ours, np.random.default_rng(seed))
        np.testing.assert_array_equal(others.cluster(DELTA), ours.cluster(DELTA))
        np.testing.assert_array_equal(others.confidence(DELTA), ours.confidence(DELTA))
        names = others.expressions[:, 0]
        np.testing.assert_array_equal(others.express(DELTA)[:, 0], names[ours.cluster(DELTA)])  # each its cluster's
        orders.add(tuple(names))
    assert orders == set(permutations([-1, 0, 1]))


def episode(number: int, steps: int) -> Episode:
    instruction = np.full((steps, 1), number) + np.arange(steps)[:, None] / 100
    states = np.full((steps + 1, 3), number)
    return Episode(states, np.zeros(steps), np.zeros(steps), instruction, np.ones(steps, bool), True, True, "lower")


def test_instructions_are_shuffled_by_whole_episodes():
    best, heard = [episode(n, 3 + n) for n in range(6)], [episode(10 + n, 4) for n in range(5)]
    new_best, new_heard = shuffle_instructions(best, heard, np.random.default_rng(1))
    for before, after in ((best, new_best), (heard, new_heard)):
        for old, new in zip(before, after, strict=True):
            np.testing.assert_array_equal(old.states, new.states)
        giver = [int(each.instructions[0, 0]) for each in after]
        assert sorted(giver) == sorted(int(each.states[0, 0]) for each in before)
        assert giver != [int(each.states[0, 0]) for each in before]
    for new in new_best:  # in order; where the other was shorter its last word holds
        number = int(new.instructions[0, 0])
        expected = number + np.minimum(np.arange(len(new)), 3 + number - 1) / 100
        np.testing.assert_allclose(new.instructions[:, 0], expected)


def test_a_moment_is_given_the_future_of_another_episode():
    episodes = [0, 0, 0, 2, 2, 5, 5, 5, 5, 9]
    here = moments([0] * 10, [[number] for number in episodes], instruction=[0] * 10, episode=episodes)
    other = of_another_moment(here, np.random.default_rng(0))
    givers = other.predicted[:, 0, 0, 0]
    assert (givers != episodes).all()
    assert set(givers) == {0, 2, 5, 9}
    np.testing.assert_array_equal(other.realised, here.realised)


def test_one_episode_has_no_other():
    with pytest.raises(ValueError, match="at least two episodes"):
        of_another_moment(moments([0, 1], [[0], [1]], instruction=[0, 0], episode=[3, 3]), np.random.default_rng(0))
