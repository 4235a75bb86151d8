"""The search for the paper's agents among policies whose success is known."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ibe_rl.apps.paper.agents import PAPER_SUCCESS, ROUND_EPISODES, PaperAgent, most_runs, screen

SEEDS = range(600, 1100)


class KnownSuccess:
    """Each policy is its own rate of success; which seeds it succeeds on is spread evenly, and exact on 300."""

    def __init__(self) -> None:
        self.rolled_out: list[tuple[Any, list[int]]] = []

    def fly(self, policy: Any, seeds: Sequence[int]) -> Any:
        self.rolled_out.append((policy, [*seeds]))
        return [SimpleNamespace(success=seed * 187 % 300 < 300 * policy.rate) for seed in seeds]

    def fly_all(self, policies: Sequence[Any], seeds: Sequence[Sequence[int]]) -> Any:
        return map(self.fly, policies, seeds)

    def seeds_of(self, policy: Any) -> list[int]:
        return [seed for one, seeds in self.rolled_out if one is policy for seed in seeds]


def policies_of(rates: Sequence[float]) -> dict[int, Any]:
    """Kept every 100 frames."""
    return {100 * (number + 1): SimpleNamespace(rate=rate) for number, rate in enumerate(rates)}


def screened(rates: Sequence[float]) -> dict[str, int]:
    return screen(policies_of(rates), KnownSuccess().fly_all, SEEDS)[0]


def curve(count: int, seed: int) -> list[float]:
    """Better and better, with ups and downs."""
    return np.clip(np.linspace(0, 1, count) + np.random.default_rng(seed).normal(0, 0.2, count), 0, 1).tolist()


def hidden() -> list[float]:
    """200 policies, every fifth of which is tried at first; the best ones for A and B lie between two of these."""
    rates = np.concatenate([np.zeros(60), np.full(6, 0.45), np.ones(134)])
    rates[62], rates[65], rates[68] = PAPER_SUCCESS["A"], 0.92, PAPER_SUCCESS["B"]
    return rates.tolist()


def test_the_nearest_are_found():
    assert screened([0.1, 0.4, 0.62, 0.7, 0.85, 0.99]) == {"A": 300, "B": 500}
    assert screened([0.99, 0.85, 0.7, 0.62, 0.4, 0.1]) == {"A": 400, "B": 200}


def test_the_nearest_of_all_is_found_where_all_are_tried():
    for seed in range(5):
        rates = curve(40, seed)
        nearest = {name: int(np.argmin(np.abs(np.array(rates) - wanted))) for name, wanted in PAPER_SUCCESS.items()}
        for name, frame in screened(rates).items():
            wanted, best = PAPER_SUCCESS[name], rates[nearest[name]]
            assert abs(rates[frame // 100 - 1] - wanted) < abs(best - wanted) + 0.04


def test_one_policy_is_both():
    assert screened([0.2]) == {"A": 100, "B": 100}


def test_of_equals_the_earliest_is_taken():
    assert screened([1.0] * 12) == {"A": 100, "B": 100}
    a, b = PAPER_SUCCESS.values()
    assert screened([0, b, a, 0, a, b, a, b]) == {"A": 300, "B": 200}


def test_policies_between_those_tried_at_first_are_found():
    rates = hidden()
    chosen, tried = screen(policies_of(rates), KnownSuccess().fly_all, SEEDS)
    assert chosen == {"A": 6_300, "B": 6_900}
    assert len(tried) < 100  # of 200
    assert len([frame for frame in tried if frame // 100 % 5 == 1]) == 40


@pytest.mark.parametrize("rates", [hidden(), curve(7, 0), curve(90, 1)], ids=["200", "7", "90"])
def test_each_rolls_out_the_first_seeds_once_and_not_more_than_the_last_round_asks_for(rates: list[float]):
    policies, field = policies_of(rates), KnownSuccess()
    chosen, tried = screen(policies, field.fly_all, SEEDS)
    for frame, policy in policies.items():
        rolled_out = field.seeds_of(policy)
        assert rolled_out == [*SEEDS[: len(rolled_out)]]
        assert len(rolled_out) in (0, *ROUND_EPISODES)
        successes = [seed * 187 % 300 < 300 * policy.rate for seed in rolled_out]
        assert tried.get(frame, []) == successes
    assert all(len(tried[frame]) == ROUND_EPISODES[-1] for frame in chosen.values())


def test_where_there_are_enough_seeds_each_policy_rolls_out_its_own():
    policies, field, seeds = policies_of(curve(12, 0)), KnownSuccess(), range(10_000)
    screen(policies, field.fly_all, seeds)
    rolled_out = [field.seeds_of(policy) for policy in policies.values()]
    assert len({seed for each in rolled_out for seed in each}) == sum(len(each) for each in rolled_out)
    assert {seed for each in rolled_out for seed in each} <= {*seeds}


@pytest.mark.parametrize("count", [1, 3, 40, 41, 200])
def test_there_are_no_more_flights_than_said(count: int):
    most = most_runs(count)
    for rates in ([0.5] * count, curve(count, 0), curve(count, 1), np.linspace(0, 1, count).tolist()):
        field, steps = KnownSuccess(), []
        screen(policies_of(rates), field.fly_all, SEEDS, lambda steps=steps: steps.append(1))
        assert len(steps) == len(field.rolled_out) <= most


def skilled(good: int, tries: int, name: str = "A") -> PaperAgent:
    rolled_out: Any = [SimpleNamespace(success=number < good) for number in range(tries)]
    return PaperAgent(name, PAPER_SUCCESS.get(name), 1_000, lambda observations: observations, rolled_out)


@pytest.mark.parametrize(
    ("name", "good", "near"),
    [
        *(("A", 190, True), ("A", 166, True), ("A", 165, False), ("A", 214, True), ("A", 215, False)),
        *(("B", 250, True), ("B", 226, True), ("B", 225, False), ("B", 274, True), ("B", 275, False)),
    ],
)
def test_near_is_up_to_8_points(name: str, good: int, near: bool):
    """24 of 300 are 8 points."""
    assert skilled(good, 300, name).near == near


@pytest.mark.parametrize("good", [0, 5, 10])
def test_the_last_agent_is_always_as_wanted(good: int):
    assert skilled(good, 10, "C").near


def test_success_is_that_of_its_own_episodes():
    found = skilled(19, 30).success
    assert (found.value, found.low, found.high) == pytest.approx((19 / 30, 0.4551, 0.7813), abs=5e-5)
