"""Places, speeds and plans, distinguished in what a hand-made log says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from masses import fly, ignores, obeys, opposes, planned, seen_as, speed_up, to_the_middle

from ibe_rl.ibe.delta import LoggedSteps
from ibe_rl.ibe.rates import depends_on_state, integral, is_rate
from ibe_rl.types import Array, Episode

PLACE, SPEED = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def record(*given: object, **settings: object) -> LoggedSteps:
    return LoggedSteps.of(fly(*given, **settings), 5)


def pendulum(episodes: int = 20, steps: int = 50, step_seconds: float = 0.05) -> list[Episode]:
    """Cosine, sine and turning of a pendulum without weight that is pushed at random."""
    made = []
    for number in range(episodes):
        chance = np.random.default_rng(number)
        angle, turning = chance.uniform(-np.pi, np.pi), chance.normal()
        states = []
        for _ in range(steps + 1):
            states.append([np.cos(angle), np.sin(angle), turning])
            turning += step_seconds * 10 * chance.normal()
            angle += step_seconds * turning
        made.append(replace(fly(episodes=1, steps=steps)[0], states=np.array(states)))
    return made


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
def test_a_speed_is_a_rate_and_a_place_is_none(agent: object) -> None:
    log = record(agent)
    assert is_rate(log, SPEED, 0)
    assert not is_rate(log, PLACE, 0)


def test_so_it_is_in_other_coordinates() -> None:
    """Mixed, scaled and shifted: the speed is no column any more."""
    mixing = np.array([[2.0, 300.0], [-1.0, 50.0]])
    log = LoggedSteps.of(seen_as(fly(), mixing, np.array([7.0, -9.0])), 5)
    back = np.linalg.inv(mixing)
    assert is_rate(log, back @ SPEED, 0)
    assert not is_rate(log, back @ PLACE, 0)


def test_the_turning_of_a_pendulum_is_a_rate_though_no_number_has_its_angle() -> None:
    log = LoggedSteps.of(pendulum(), 5)
    turning, height = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    assert is_rate(log, turning, 0)
    assert not is_rate(log, height, 0)
    assert not is_rate(log, np.array([0, 1.0, 0]), 0)


def test_what_never_changes_is_no_rate() -> None:
    log = record()
    still = replace(log, states=np.ones_like(log.states), next_states=np.ones_like(log.next_states))
    assert not is_rate(still, PLACE, 0)


def test_with_many_dimensions_products_are_left_out() -> None:
    """The same pendulum beside 20 numbers that say nothing: only a linear fit is tried."""
    chance = np.random.default_rng(0)
    crowd = [replace(one, states=np.column_stack([one.states, chance.normal(size=(51, 20))])) for one in pendulum()]
    assert not is_rate(LoggedSteps.of(crowd, 5), np.eye(23)[2], 0)
    beside = [replace(one, states=np.column_stack([one.states, chance.normal(size=(41, 20))])) for one in fly()]
    assert is_rate(LoggedSteps.of(beside, 5), np.eye(22)[1], 0)  # a linear one is enough for a speed


@pytest.mark.parametrize("scale", [1.0, 1_000.0])
def test_what_changes_by_a_speed_is_the_place(scale: float) -> None:
    log = LoggedSteps.of(seen_as(fly(), np.diag([scale, 1.0]), np.zeros(2)), 5)
    found = integral(log, SPEED)
    # the mean speed over a step is how far it went, less half of what the speed rose by
    np.testing.assert_allclose(found, [1 / scale, -0.5], rtol=1e-3)


def test_what_never_changes_is_the_place_of_nothing() -> None:
    log = record()
    frozen = replace(log, states=log.states * [0, 1], next_states=log.next_states * [0, 1])
    assert integral(frozen, SPEED)[0] == 0


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
def test_a_rule_of_the_state_depends_on_it(agent: object) -> None:
    assert depends_on_state(record(agent, to_the_middle), 0, 0)
    assert depends_on_state(record(agent, speed_up), 0, 0)


@pytest.mark.parametrize("agent", [obeys, ignores, opposes])
@pytest.mark.parametrize("seed", range(3))
def test_a_plan_does_not_whoever_follows_it(agent: object, seed: int) -> None:
    assert not depends_on_state(record(agent, planned, seed=seed), 0, seed)


def same_plan(_state: Array, step: int, _episode: int) -> float:
    return float(np.sign(step - 20))


def test_a_plan_that_is_always_the_same_is_recognised_by_the_step() -> None:
    assert not depends_on_state(record(obeys, same_plan), 0, 0)


def test_an_instructor_who_hardly_speaks_may_go_by_the_state() -> None:
    """With silence around every word there are no onsets to check it at."""
    log = record(ignores, to_the_middle, heard_every=8)
    assert len(log.onsets(0)) < 10
    assert depends_on_state(log, 0, 0)


def test_a_single_episode_is_enough_to_see_a_rule() -> None:
    assert depends_on_state(record(ignores, to_the_middle, episodes=1, steps=400, seed=1), 0, 0)


@pytest.mark.parametrize("number", range(8))
def test_a_word_that_was_said_once_tells_no_rule(number: int) -> None:
    """Whichever part of the log it falls into."""

    def once(_state: Array, step: int, episode: int) -> float:
        return float((step, episode) == (number, number))

    assert not depends_on_state(record(ignores, once), 0, 0)


def test_a_word_that_is_not_in_the_sample_tells_no_rule() -> None:
    """One step of 4,000, of which every other one is looked at."""

    def once(_state: Array, step: int, episode: int) -> float:
        return float((step, episode) == (0, 0))

    logs = [record(ignores, once, episodes=100, seed=seed) for seed in range(3)]
    assert not any(depends_on_state(log, 0, seed) for seed, log in enumerate(logs))


def test_the_same_seed_gives_the_same() -> None:
    log = record(obeys, planned)
    assert [depends_on_state(log, 0, 3) for _ in range(2)] == [False, False]
    assert integral(log, SPEED).tolist() == integral(log, SPEED).tolist()
