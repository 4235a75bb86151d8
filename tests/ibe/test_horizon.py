"""How long movements last, worked out on swings of a known period and on movements that never turn."""

from collections.abc import Sequence

import numpy as np
import pytest

from ibe_rl.ibe import find_horizon, instruction_lasts, leading_change
from ibe_rl.ibe.horizon import MIN_HORIZON_STEPS
from ibe_rl.types import Array

PLACE = np.array([[1.0], [0.0]])


def swings(period: float, steps: int = 400, episodes: int = 10) -> list[Array]:
    """A pendulum of a steady swing, begun at another phase each time; the second dimension is noise."""
    random = np.random.default_rng(0)
    return [
        np.column_stack([np.sin(2 * np.pi * (np.arange(steps + 1) / period + phase)), random.normal(size=steps + 1)])
        for phase in random.random(episodes)
    ]


@pytest.mark.parametrize("period", [30, 60, 120, 240])
def test_of_a_swing_it_is_a_bit_more_than_a_quarter_of_the_period(period: int):
    """The way over n steps grows with |sin(pi n / period)|: 2 cos(pi n / period) is 1.25 at .285 of the period."""
    assert find_horizon(swings(period), PLACE) == pytest.approx(0.285 * period, abs=1 + 0.02 * period)


def test_scale_and_place_do_not_matter():
    far = [states * 1_000 - 300 for states in swings(60)]
    assert find_horizon(far, PLACE) == find_horizon(swings(60), PLACE * 0.01) == find_horizon(swings(60), -PLACE)


def test_a_movement_that_never_turns_is_explained_for_a_fifth_of_an_episode():
    rising = [np.column_stack([np.arange(steps + 1.0), np.zeros(steps + 1)]) for steps in (100, 300, 200)]
    assert find_horizon(rising, PLACE) == 40


def test_a_random_walk_goes_on_too():
    """Twice as long leads 1.4 times as far."""
    walks = np.random.default_rng(0).normal(size=(40, 301, 1)).cumsum(axis=1)
    assert find_horizon(list(walks), np.ones((1, 1))) == 60


def test_of_several_numbers_the_shortest_movement_counts():
    both = [np.column_stack([slow[:, 0], fast[:, 0]]) for slow, fast in zip(swings(120), swings(60), strict=True)]
    assert find_horizon(both, np.eye(2)) == find_horizon(swings(60), PLACE)


def test_it_is_at_least_five_steps():
    """Pure noise goes nowhere from the first step on."""
    noise = list(np.random.default_rng(0).normal(size=(10, 201, 1)))
    assert find_horizon(noise, np.ones((1, 1))) == 5
    assert find_horizon(swings(10), PLACE) == 5


@pytest.mark.parametrize(("steps", "expected"), [([1], 1), ([2], 2), ([2, 2, 9], 2), ([7], 5), ([0, 30], 6)])
def test_of_short_episodes_it_is_what_fits(steps: Sequence[int], expected: int):
    rising = [np.arange(each + 1.0)[:, None] for each in steps]
    assert find_horizon(rising, np.ones((1, 1))) == expected


def test_what_never_moves_says_nothing():
    assert find_horizon([np.ones((101, 2))], PLACE) == 20


def test_a_long_log_is_looked_at_in_part():
    """The first 10,000 rows decide; the median length is of all episodes."""
    many = swings(60, steps=1_000, episodes=20) + [np.zeros((1_001, 2))] * 100
    assert find_horizon(many, PLACE) == find_horizon(swings(60), PLACE)


def test_without_an_episode_there_is_none():
    for nothing in ([], [np.zeros((1, 2))]):
        with pytest.raises(ValueError, match="find_horizon needs an episode with a step"):
            find_horizon(nothing, PLACE)


def test_the_leading_change_is_what_goes_together():
    """Two dimensions move as one, a third by itself; in what units does not matter."""
    random = np.random.default_rng(0)
    walk, other = random.normal(size=(2, 500)).cumsum(axis=1)
    states = [np.column_stack([walk, 1_000 * walk, other, np.ones(500)])]
    found = leading_change(states, np.ones(4, bool))[:, 0]
    assert found[0] / found[1] == pytest.approx(1_000)
    assert abs(found[2]) < 0.1 * abs(found[0])
    assert found[3] == 0
    alone = leading_change(states, np.array([False, False, True, False]))[:, 0]
    assert np.flatnonzero(alone).tolist() == [2]
    assert leading_change([np.ones((2, 1))], np.ones(1, bool)).tolist() == [[0]]


def test_an_instruction_lasts_until_another_one_is_given() -> None:
    """Eight steps right, then nothing, then four left: 8 to 1 and 4 to 1 steps are left, the median is 3.5."""
    one = np.array([1.0] * 8 + [0.0] * 5 + [-1.0] * 4)[:, None]
    assert instruction_lasts([one, np.zeros((9, 1))]) == MIN_HORIZON_STEPS  # 3.5 is less than the fewest
    assert instruction_lasts([np.ones((41, 1))]) == 21
    assert instruction_lasts([np.ones((41, 1)), -np.ones((41, 1))]) == 21
    assert instruction_lasts([np.column_stack([np.ones(41), np.repeat([1, -1], [21, 20])])]) == 11
    assert instruction_lasts([np.column_stack([np.ones(41), np.zeros(41)])]) == 21
    assert instruction_lasts([np.zeros((9, 2))]) is None
    assert instruction_lasts([]) is None
