"""How far two groups differ, and whether paired errors do; all worked out by hand."""

import numpy as np
import pytest

from ibe_rl.metrics.effect import Effect, Groups, corrected, effect, paired_p, share
from ibe_rl.types import Array


def group(*values: float) -> Array:
    return np.array(values, float)


def compared(*strata: Groups, resamples: int = 50, seed: int = 0) -> Effect:
    found = effect(strata, resamples, seed)
    assert found is not None
    return found


def test_means_and_the_chance_of_having_more():
    found = compared((group(1, 2, 3), group(0, 2)))
    assert found.counts == (3, 2)
    assert found.means == pytest.approx((2, 1))
    assert found.difference.value == pytest.approx(1)
    assert found.superiority.value == pytest.approx((1 + 1.5 + 2) / 6)  # 1 beats 0; 2 beats 0 and ties; 3 beats both


@pytest.mark.parametrize(("first", "chance"), [(1, 0.5), (2, 1), (0, 0)])
def test_ties_count_half(first: float, chance: float):
    estimate = compared((np.full(4, first), np.ones(3))).superiority
    assert (estimate.value, estimate.low, estimate.high) == pytest.approx((chance, chance, chance))


def test_the_groups_turned_round_turn_the_effect_round():
    first, second = group(1, 2, 5), group(0, 2, 3, 4)
    one, other = compared((first, second)), compared((second, first))
    assert one.difference.value == pytest.approx(-other.difference.value)
    assert one.superiority.value == pytest.approx(1 - other.superiority.value)


def test_nothing_is_compared_across_strata():
    """Where the first group is high so is the second, and always higher: all 20 beat all 2, but never their own."""
    apart = compared((group(20), group(21)), (group(1), group(2)))
    assert (apart.superiority.value, apart.difference.value) == pytest.approx((0, -1))
    together = compared((group(20, 1), group(21, 2)))
    assert together.superiority.value == pytest.approx(0.25)


def test_strata_count_by_the_first_group_and_by_their_pairs():
    found = compared((group(10, 10, 10), group(8)), (group(0), group(1, 1, 1, 1, 1, 1)))
    assert found.counts == (4, 7)
    assert found.means == pytest.approx(((3 * 10 + 0) / 4, (3 * 8 + 1) / 4))
    assert found.difference.value == pytest.approx((3 * 2 - 1) / 4)
    assert found.superiority.value == pytest.approx(3 / 9)  # 3 pairs won, 6 lost


def test_resamples_are_drawn_within_each_group_of_each_stratum():
    found = compared((group(1, 1), group(0, 0)), (group(5, 5), group(5, 5)))
    for estimate, value in ((found.difference, 0.5), (found.superiority, 0.75)):
        assert (estimate.value, estimate.low, estimate.high) == pytest.approx((value, value, value))


def test_a_stratum_with_one_group_only_says_nothing():
    alone = compared((group(1, 3), group(0)))
    assert compared((group(1, 3), group(0)), (group(7, 9), group()), (group(), group(9))) == alone
    assert effect([(group(7), group()), (group(), group(9))]) is None
    assert effect([]) is None


def test_the_same_seed_gives_the_same_interval():
    random = np.random.default_rng(0)
    groups = random.normal(size=12), random.normal(size=15)
    assert compared(groups, seed=3) == compared(groups, seed=3)
    assert compared(groups, seed=3).difference.value == compared(groups, seed=4).difference.value
    assert compared(groups, seed=3).difference.low != compared(groups, seed=4).difference.low


def test_intervals_contain_the_truth_about_as_often_as_they_say():
    random, held = np.random.default_rng(1), []
    for _ in range(100):
        found = compared((random.normal(1, 1, 40), random.normal(0, 1, 40)), resamples=200)
        truths = ((found.difference, 1.0), (found.superiority, 0.7602))  # the normal distribution's at 1 / sqrt(2)
        held.append([estimate.low <= truth <= estimate.high for estimate, truth in truths])
    assert ((np.mean(held, axis=0) > 0.88) & (np.mean(held, axis=0) < 1)).all()


def test_intervals_shrink_with_more_episodes():
    random = np.random.default_rng(2)
    few, many = (compared((random.normal(1, 1, n), random.normal(0, 1, n)), resamples=300) for n in (20, 500))
    for name in ("difference", "superiority"):
        less, more = getattr(few, name), getattr(many, name)
        assert 0.1 < (more.high - more.low) / (less.high - less.low) < 0.4  # a fifth, more or less


@pytest.mark.parametrize(
    ("differences", "p"),
    [
        ([1, 1, 1, 1, 1], 2 / 32),  # of all 32 ways to turn signs only the two ends are as far out
        ([1, 2, 4, -0.5], 2 * 2 / 16),  # 7.5 and 6.5 itself are as high
        ([3, -1], 1.0),
        ([2, -2], 1.0),
    ],
)
def test_p_of_few_differences_counts_all_ways_to_turn_their_signs(differences: list[float], p: float):
    assert paired_p(group(*differences)) == pytest.approx(p)
    assert paired_p(-group(*differences)) == pytest.approx(p)


def test_p_is_small_where_all_go_one_way_and_large_where_they_cancel():
    sizes = np.random.default_rng(0).uniform(1, 2, 30)
    assert paired_p(sizes) == paired_p(-sizes) < 0.001
    assert paired_p(np.concatenate([sizes, -sizes])) > 0.9


def test_p_of_many_differences_is_that_of_the_seed():
    some = np.random.default_rng(1).normal(0.2, 1, 30)
    assert paired_p(some, 500, seed=1) == paired_p(some, 500, seed=1) != paired_p(some, 500, seed=2)
    assert paired_p(some, 500) == pytest.approx(paired_p(some), abs=0.1)


def test_where_nothing_differs_p_is_as_seldom_small_as_it_says():
    random = np.random.default_rng(3)
    small = [paired_p(random.normal(0, 1, 8)) <= 0.05 for _ in range(300)]
    assert 0.01 < np.mean(small) < 0.1


def test_no_difference_at_all_is_no_evidence():
    assert paired_p(np.zeros(5)) == 1


def test_without_episodes_there_is_nothing_to_test():
    with pytest.raises(ValueError, match="no episodes: there is no difference to test"):
        paired_p(np.zeros(0))


def test_p_values_are_corrected_for_how_many_there_are():
    """Benjamini and Yekutieli: the i-th smallest of m times m / i and 1 + 1/2 + ... + 1/m, none above a later one."""
    sums = 1 + 1 / 2 + 1 / 3
    assert corrected([0.01, 0.04, 0.03]) == pytest.approx([0.01 * 3 * sums, 0.04 * sums, 0.04 * sums])
    assert corrected([0.001, 0.02]) == pytest.approx([0.001 * 2 * 1.5, 0.02 * 1.5])
    assert corrected([0.9, 0.8]) == [1, 1]
    assert corrected([0.03]) == pytest.approx([0.03])
    assert corrected([]) == []


def test_more_tests_make_each_weaker():
    firsts = [corrected([0.001, *([0.5] * more)])[0] for more in range(6)]
    assert firsts[0] == pytest.approx(0.001)
    assert (np.diff(firsts) > 0).all()


@pytest.mark.parametrize(
    ("good", "tries", "low", "high"),
    [(19, 30, 0.4551, 0.7813), (25, 30, 0.6644, 0.9266), (0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0)],
)
def test_a_share_has_wilsons_interval(good: int, tries: int, low: float, high: float):
    estimate = share([True] * good + [False] * (tries - good))
    assert estimate.value == pytest.approx(good / tries)
    assert (estimate.low, estimate.high) == pytest.approx((low, high), abs=5e-5)


def test_without_tries_there_is_no_share():
    with pytest.raises(ValueError, match="no tries: there is no share of successes"):
        share([])
