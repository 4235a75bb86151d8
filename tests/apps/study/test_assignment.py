"""Arms are balanced whoever drops out, and orders are counterbalanced."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from ibe_rl.apps.study.assignment import assign, mixed_orders, orders_of

ARMS = ["none", "paper", "ibe", "placebic", "true_future"]


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_each_arm_is_equally_often_at_each_place_and_after_each_other(count: int) -> None:
    orders = orders_of(ARMS[:count], within=True)
    assert len(orders) == count * (1 + count % 2)
    places = Counter((place, arm) for order in orders for place, arm in enumerate(order))
    assert set(places.values()) == {1 + count % 2}
    assert len(places) == count * count
    followers = Counter(pair for order in orders for pair in pairwise(order))
    assert set(followers.values()) == {1 + count % 2}
    assert len(followers) == count * (count - 1)


def test_between_persons_everybody_has_one_arm() -> None:
    assert orders_of(ARMS[:3], within=False) == [("none",), ("paper",), ("ibe",)]


def test_mixed_everybody_has_a_block_without_and_one_with_in_either_order() -> None:
    orders = mixed_orders(["ibe", "none", "paper"], "none")
    assert sorted(orders) == [("ibe", "none"), ("none", "ibe"), ("none", "paper"), ("paper", "none")]


def test_an_arm_that_fewer_hold_comes_next() -> None:
    orders = orders_of(ARMS[:3], within=False)
    assert assign(orders, finished=[orders[0]], under_way=[orders[2]], seed=0) == orders[1]
    assert assign(orders, finished=[orders[0]], under_way=[orders[1], orders[2]], seed=0) in orders[1:]


def test_the_lot_depends_on_the_seed_alone() -> None:
    orders = orders_of(ARMS[:2], within=False)
    drawn = [assign(orders, [], [], seed) for seed in range(40)]
    assert drawn == [assign(orders, [], [], seed) for seed in range(40)]
    assert set(drawn) == set(orders)


@pytest.mark.parametrize("within", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_arms_are_even_after_sixty_finished_people_of_whom_a_third_dropped_out(within: bool, seed: int) -> None:
    """Twenty are under way at a time; who drops out gives the place back."""
    random, orders = np.random.default_rng(seed), orders_of(ARMS[:3], within)
    finished: list = []
    active: list = []
    person = 0
    while len(finished) < 60:
        while len(active) < min(20, 60 - len(finished)):  # the quota
            active.append(assign(orders, finished, active, seed * 1000 + person))
            person += 1
        leaving = active.pop(int(random.integers(len(active))))
        if random.random() > 1 / 3:
            finished.append(leaving)
    counts = [finished.count(order) for order in orders]
    assert max(counts) - min(counts) <= 1
