"""Clusters on a line, and windows few enough to count what they share."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from by_hand import column, on_a_line, plain

from ibe_rl.ibe import ClusterMapping, ClusterTransition, keep_identity
from ibe_rl.types import Array

NEAR = column(1, 2, 3, 4, 8, 9)
"""With centres at 0 and 10 the first four are one cluster's, with centres at 0 and 30 all of them."""


def continued(
    last: ClusterMapping, new: ClusterMapping, probe: Array, **settings: Any
) -> tuple[Any, ClusterTransition]:
    mapping, transition = keep_identity(last, new, probe, int(last.ids.max()) + 1, **settings)
    return mapping.ids.tolist(), transition


def test_one_survives_one_vanishes_one_emerges():
    """The centres count too: 0, 0, 1, 2, 3, 4 of 0, 0, 1, 2, 3, 4, 8, 9, 10 stay together, and 30 of 8, 9, 10, 30."""
    ids, transition = continued(on_a_line([0, 10]), on_a_line([0, 30]), NEAR)
    assert ids == [0, 2]
    assert transition == ClusterTransition({0: 6 / 9}, (1,), (2,))


def test_an_id_is_never_given_twice():
    """The second cluster leaves and comes back to the same place: under a third and a fourth name."""
    last, next_id, seen = on_a_line([0, 10]), 2, [[0, 1]]
    for where in (30, 10, 30):
        last, transition = keep_identity(last, on_a_line([0, where]), NEAR, next_id)
        next_id = max(next_id, int(last.ids.max()) + 1)
        seen.append(last.ids.tolist())
        assert transition.survived == {0: 6 / 9}
        assert (list(transition.vanished), list(transition.emerged)) == (seen[-2][1:], seen[-1][1:])
    assert seen == [[0, 1], [0, 2], [0, 3], [0, 4]]


def test_clusters_in_another_order_keep_their_names():
    last = on_a_line([0, 10, 20], ids=[5, 2, 9])
    for order in ([1, 0, 2], [2, 1, 0], [1, 2, 0], [2, 0, 1]):
        new = on_a_line(np.array([0.0, 10, 20])[order])
        ids, transition = continued(last, new, column(1, 11, 19, 21))
        assert ids == np.array([5, 2, 9])[order].tolist()
        assert transition == ClusterTransition({5: 1.0, 2: 1.0, 9: 1.0}, (), ())


def test_a_cluster_that_the_probe_never_reaches_is_known_by_its_centre():
    ids, transition = continued(on_a_line([0, 100], ids=[3, 7]), on_a_line([101, 0]), column(1, 2, 3))
    assert ids == [7, 3]
    assert transition.survived == {7: 1.0, 3: 1.0}


@pytest.mark.parametrize(
    ("limit", "survived"), [(0.5, {0: 0.5}), (float(np.nextafter(0.5, 1)), {}), (0.25, {0: 0.5, 1: 0.25})]
)
def test_just_as_much_in_common_as_asked_for_survives(limit: float, survived: dict[int, float]):
    """0, 0, 1 of 0, 0, 1, 8, 9, 10 stay together, and 30 of 8, 9, 10, 30."""
    ids, transition = continued(on_a_line([0, 10]), on_a_line([0, 30]), column(1, 8, 9), survival_overlap=limit)
    assert transition.survived == survived
    assert transition.vanished == tuple(name for name in (0, 1) if name not in survived)
    assert ids == [name if name in survived else 2 + name - len(survived) for name in (0, 1)]


def test_the_sum_of_the_overlaps_is_what_counts():
    """Boundaries at 10 and at 3: 4 of 10 and 4 of 10 windows stay; 6 of 14 would be the largest single overlap."""
    ids, transition = continued(
        on_a_line([0, 20]), on_a_line([0, 6]), column(1, 2, 4, 5, 7, 8, 9, 11, 12, 13), survival_overlap=0.3
    )
    assert ids == [0, 1]
    assert transition.survived == {0: 0.4, 1: 0.4}


@pytest.mark.parametrize(("limit", "kept"), [(0.25, True), (0.2499, False), (0.0, False)])
def test_words_are_held_up_to_the_limit(limit: float, kept: bool):
    last, new = on_a_line([0, 10], [-1, 0.5]), on_a_line([0, 10], [-1, 0.75])
    held, _ = keep_identity(last, new, column(1), 2, hold_within=limit)
    assert held.expressions.tolist() == [[-1], [0.5 if kept else 0.75]]
    assert new.expressions.tolist() == [[-1], [0.75]]
    back, _ = keep_identity(new, last, column(1), 2, hold_within=limit)  # downwards as upwards
    assert back.expressions.tolist() == [[-1], [0.75 if kept else 0.5]]


def test_words_cannot_creep_away_in_small_steps():
    """What moves is measured against what is said, not against what was learnt the last time."""
    last, said = on_a_line([0, 10], [-1, 0]), []
    for learnt in (0.125, 0.25, 0.375, 0.5, 0.625):
        last, _ = keep_identity(last, on_a_line([0, 10], [-1, learnt]), column(1), 2, hold_within=0.25)
        said.append(last.expressions[1, 0])
    assert said == [0, 0, 0.375, 0.375, 0.375]


def test_words_of_several_numbers_are_held_together():
    def at(first: float, second: float) -> ClusterMapping:
        one = on_a_line([0, 10])
        two = np.array([[0, 0], [first, second]])
        return replace(one, expressions=two, mean_instructions=two)

    held, _ = keep_identity(at(0.5, 0.5), at(0.6, 0.7), column(1), 2, hold_within=0.25)
    assert held.expressions[1].tolist() == [0.5, 0.5]
    moved, _ = keep_identity(at(0.5, 0.5), at(0.6, 0.9), column(1), 2, hold_within=0.25)
    assert moved.expressions[1].tolist() == [0.6, 0.9]


def test_words_of_a_cluster_that_emerged_are_its_own():
    new, _ = keep_identity(on_a_line([0, 10], [-1, 1]), on_a_line([0, 30], [-0.9, 0.9]), NEAR, 2, hold_within=2)
    assert new.expressions.tolist() == [[-1], [0.9]]


def test_nothing_but_names_and_words_is_touched():
    new = on_a_line([0, 30], [-0.9, 0.9], evidence=[4, 6])
    kept, _ = keep_identity(on_a_line([0, 10], [-1, 1]), new, NEAR, 2, hold_within=2)
    assert kept.to_dict() | {"ids": 0, "expressions": 0} == new.to_dict() | {"ids": 0, "expressions": 0}


def some(random: np.random.Generator, k: int) -> ClusterMapping:
    one = on_a_line(np.zeros(k), random.uniform(-1, 1, k), random.choice(50, k, replace=False))
    return replace(one, space=plain(2), centres=random.normal(size=(k, 2)))


@pytest.mark.parametrize("seed", range(40))
def test_whatever_the_clusters_names_are_kept_given_and_dropped_once(seed: int):
    random = np.random.default_rng(seed)
    last, new = some(random, int(random.integers(2, 9))), some(random, int(random.integers(2, 9)))
    probe, limit = random.normal(size=(int(random.choice([0, 1, 60])), 2)), float(random.uniform(0.05, 1))
    mapping, transition = keep_identity(last, new, probe, 50, survival_overlap=limit, hold_within=0.5)
    survived, vanished, emerged = set(transition.survived), set(transition.vanished), set(transition.emerged)
    names = mapping.ids.tolist()
    assert len(set(names)) == len(names) == len(new.ids)
    assert survived | emerged == set(names)
    assert survived | vanished == set(last.ids.tolist())
    assert not survived & (vanished | emerged)
    assert emerged == set(range(50, 50 + len(transition.emerged)))
    assert all(limit <= overlap <= 1 for overlap in transition.survived.values())
    for row, name in enumerate(names):
        before = last.expressions[last.ids == name]
        held = len(before) and abs(before[0, 0] - new.expressions[row, 0]) <= 0.5
        assert mapping.expressions[row, 0] == (before[0, 0] if held else new.expressions[row, 0])


@pytest.mark.parametrize("seed", range(10))
def test_a_mapping_continues_itself(seed: int):
    random = np.random.default_rng(seed)
    last = some(random, 6)
    again, transition = keep_identity(last, last, random.normal(size=(30, 2)), 50, survival_overlap=1)
    assert again.to_dict() == last.to_dict()
    assert transition.survived == dict.fromkeys(last.ids.tolist(), 1.0)


def test_a_transition_is_plain_values_for_a_file():
    assert ClusterTransition({4: 0.75, 2: 0.5}, (1,), (5, 6)).to_dict() == {
        "survived": [{"id": 4, "overlap": 0.75}, {"id": 2, "overlap": 0.5}],
        "vanished": [1],
        "emerged": [5, 6],
    }
