"""The registered test has p-values that can be counted by hand, and knows no difference between episodes."""

from __future__ import annotations

import numpy as np
import pytest
from answered_study import trials
from scipy import stats

from ibe_rl.apps.study.registered import TwoArms, compared, crossed_interval, effect_size, flip_p, permutation_p
from ibe_rl.metrics.effect import paired_p

ARMS = ("ibe", "none")


def between(first: list[float], second: list[float]):
    """One episode, one answer of each person."""
    losses = [*(("ibe", loss) for loss in first), *(("none", loss) for loss in second)]
    return trials([(person, 0, arm, loss) for person, (arm, loss) in enumerate(losses)])


def within(differences: list[float]):
    """Two episodes, each person with one under each arm in turn."""
    rows = []
    for person, difference in enumerate(differences):
        rows += [(person, person % 2, "ibe", 50 + difference), (person, 1 - person % 2, "none", 50.0)]
    return trials(rows)


def test_shuffles_between_three_and_three_people() -> None:
    two = TwoArms.of(between([1, 2, 3], [4, 5, 6]), ARMS)
    assert not two.paired
    assert permutation_p(two, 10_000) == pytest.approx(2 / 20)  # this and its mirror image of 20 shuffles
    assert permutation_p(TwoArms.of(between([1, 2, 4], [3, 5, 6]), ARMS), 10_000) == pytest.approx(4 / 20)


def test_flips_within_four_people() -> None:
    two = TwoArms.of(within([-1, -2, -3, -4]), ARMS)
    assert two.paired
    assert two.counts == (4, 4)
    assert permutation_p(two, 10_000) == pytest.approx(2 / 16)


def test_the_other_sign_is_as_sure() -> None:
    assert permutation_p(TwoArms.of(between([4, 5, 6], [1, 2, 3]), ARMS), 10_000) == pytest.approx(2 / 20)


@pytest.mark.parametrize("resamples", [2_000, 25_000])
def test_drawn_permutations_are_as_those_of_scipy(resamples: int) -> None:
    random = np.random.default_rng(5)
    first, second = random.normal(0, 1, 14), random.normal(0.7, 1, 16)
    found = permutation_p(TwoArms.of(between([*first], [*second]), ARMS), resamples)
    test = stats.permutation_test(
        (first, second), lambda a, b, axis: a.mean(axis=axis) - b.mean(axis=axis), n_resamples=20_000, rng=random
    )
    assert 0.01 < found == pytest.approx(test.pvalue, abs=0.02)
    differences = random.normal(0.4, 1, 20)
    assert flip_p(differences, resamples) == pytest.approx(paired_p(differences, 20_000), abs=0.02)


def test_no_difference_is_none() -> None:
    assert permutation_p(TwoArms.of(between([5, 5, 5], [5, 5, 5]), ARMS), 10_000) == 1.0


@pytest.mark.parametrize("first", [[], [1.0]])
def test_too_few_people_show_nothing(first: list[float]) -> None:
    table = between(first, [2.0, 3.0])
    assert permutation_p(TwoArms.of(table, ARMS), 100) == 1.0
    found = compared(table, ARMS, 100)
    assert found["people"] == [len(first), 2]
    assert found["p"] is None
    assert found["difference"] is None


def test_hard_episodes_are_no_difference_between_people() -> None:
    """Person 0 sees hard episodes under one arm, person 1 easy ones; every arm is 2 worse than the other."""
    hard = {0: 10.0, 1: 60.0, 2: 20.0, 3: 70.0}
    rows = [
        (person, episode, arm, hard[episode] + (0.0 if arm == "ibe" else 2.0))
        for person in range(4)
        for episode in hard
        for arm in [("ibe", "none")[(person + episode) % 2]]
    ]
    two = TwoArms.of(trials(rows), ARMS)
    first, second = two.person_means()
    assert first == pytest.approx([-1.0] * 4)
    assert second == pytest.approx([1.0] * 4)
    raw, _ = two.person_means(centred=False)
    assert raw.max() - raw.min() > 40


def test_people_with_one_of_two_arms_are_left_out_of_pairs() -> None:
    rows = [(0, 0, "ibe", 1.0), (0, 1, "none", 2.0), (1, 0, "ibe", 1.0), (1, 1, "none", 2.0), (2, 0, "ibe", 90.0)]
    assert TwoArms.of(trials(rows), ARMS).counts == (2, 2)


def test_other_arms_are_left_out() -> None:
    rows = [(0, 0, "ibe", 1.0), (1, 0, "none", 2.0), (2, 0, "paper", 3.0)]
    assert TwoArms.of(trials(rows), ARMS).loss.shape == (2, 1)


def test_effect_sizes_by_hand() -> None:
    """Means 2 and 5, both variances 1: d = -3, and g is 1 - 3 / (4 * 4 - 1) of it."""
    found = effect_size(TwoArms.of(between([1, 2, 3], [4, 5, 6]), ARMS), 200)
    assert found.value == pytest.approx(-3 * (1 - 3 / 15))
    paired = effect_size(TwoArms.of(within([-1, -2, -3, -4]), ARMS), 200)
    differences = [-1.5, -1.5, -3.5, -3.5]  # the episodes' means, 49 and 48.5, are taken away
    assert paired.value == pytest.approx(np.mean(differences) / np.std(differences, ddof=1) * (1 - 3 / 11))


def test_an_episode_under_one_arm_only_tells_nothing() -> None:
    rows = [(person, episode, arm, 5.0 * episode) for person in range(3) for episode, arm in enumerate(ARMS)]
    found = compared(trials(rows), ARMS, 100)
    assert found["difference"]["value"] == pytest.approx(0)
    assert (found["episodes"], found["episodes_of_both"]) == (2, 0)


def test_the_interval_covers_what_is_drawn() -> None:
    """Of 60 simulated studies with a true difference of -5 at least 54 intervals of 95 % cover it."""
    covered = 0
    for seed in range(60):
        random = np.random.default_rng(seed)
        skill, hard = random.normal(0, 4, 30), random.normal(0, 6, 10)
        rows = [
            (
                person,
                episode,
                ARMS[person % 2],
                30 + skill[person] + hard[episode] - 5 * (1 - person % 2) + random.normal(0, 8),
            )
            for person in range(30)
            for episode in range(10)
        ]
        found = crossed_interval(TwoArms.of(trials(rows), ARMS), 300, seed)
        covered += found.low <= -5 <= found.high
    assert covered >= 54


def test_a_comparison_has_all_numbers() -> None:
    found = compared(within([-1, -2, -3, -4]), ARMS, 500)
    assert found["means"] == pytest.approx([47.5, 50])
    assert (found["episodes"], found["episodes_of_both"]) == (2, 2)
    assert found["difference"]["low"] <= found["difference"]["value"] <= found["difference"]["high"] < 0
    assert found["p_episodes"] == pytest.approx(0.5)  # two episodes: 2 of 4 flips
    assert compared(between([1, 2, 3], [4, 5, 6]), ARMS, 500)["p_episodes"] is None


def test_the_same_seed_gives_the_same_numbers() -> None:
    table = between([*range(12)], [*range(5, 20)])
    assert compared(table, ARMS, 300, seed=3) == compared(table, ARMS, 300, seed=3)
