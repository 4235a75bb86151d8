"""Instructors whose delay is known: a cart that is told which way its goal lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ibe_rl.ibe.delay import Delay
from ibe_rl.ibe.find_delay import find_delay
from ibe_rl.instructors.flawed import FlawedConfig, corrupted
from ibe_rl.types import Array, Episode

VALUES = (-1.0, 0.0, 1.0)
STEPS = 120


def rule(states: Array) -> Array:
    """Which way the goal lies, 0 near it."""
    offset = states[..., 2] - states[..., 0]
    return np.where(np.abs(offset) > 0.3, np.sign(offset), 0.0)


def carts(count: int = 80, seed: int = 0, says: Array | None = None) -> list[Episode]:
    """Carts that drive to goals which jump now and then; place, speed, goal and a dimension of noise."""
    random = np.random.default_rng(seed)
    states = np.zeros((count, STEPS + 1, 4))
    place, speed, goal = random.normal(0, 1, (3, count))
    for step in range(STEPS + 1):
        goal = np.where(random.random(count) < 0.02, random.normal(0, 1.5, count), goal)
        states[:, step] = np.stack([place, speed, goal, random.normal(size=count)], axis=1)
        speed = speed + 0.02 * (goal - place) - 0.15 * speed + random.normal(0, 0.02, count)
        place = place + speed
    said = rule(states[:, :-1]) if says is None else says
    return [
        Episode(
            states=each.astype(np.float32),
            actions=np.zeros(STEPS, int),
            rewards=np.zeros(STEPS),
            instructions=told[:, None].astype(np.float32),
            given=np.ones(STEPS, bool),
            terminated=False,
            success=False,
            context="",
        )
        for each, told in zip(states, said, strict=True)
    ]


def flawed(episodes: list[Episode] | None = None, **flaws: float) -> list[Episode]:
    """The same with the instructions of a flawed instructor."""
    return corrupted(episodes or carts(), VALUES, FlawedConfig(**flaws), seed=1)  # type: ignore[arg-type]  # by name


def test_who_is_not_late_is_not_taken_back_a_single_step():
    found = find_delay(carts())
    assert (found.steps, found.known) == (0, True)
    assert found.low == 0


@pytest.mark.parametrize("late", [6, 25])
def test_the_delay_is_found_although_place_and_speed_tell_the_past(late: int):
    found = find_delay(flawed(late_steps=late))
    assert found.known
    assert abs(found.steps - late) <= 1
    assert found.low <= found.steps <= found.high


def test_mistakes_and_absence_do_not_hide_it():
    found = find_delay(flawed(carts(160), late_steps=15, wrong=0.2, present=0.5))
    assert found.known
    assert abs(found.steps - 15) <= 5


def test_words_are_told_apart_without_an_order():
    late = flawed(late_steps=12)
    words = [replace(one, instructions=_one_hot(one)) for one in late]
    assert abs(find_delay(words).steps - 12) <= 1


def _one_hot(episode: Episode) -> Array:
    shown = np.eye(3, dtype=np.float32)[np.rint(episode.instructions[:, 0]).astype(int) + 1]
    shown[~episode.given] = 0
    return shown


def silent_between() -> list[Episode]:
    """Only left and right are said, ten steps late, and nothing near the goal."""
    return [replace(one, given=one.given & (one.instructions[:, 0] != 0)) for one in flawed(late_steps=10)]


def test_silence_tells_it_where_nobody_says_that_it_is_well():
    assert abs(find_delay(silent_between()).steps - 10) <= 1


def plans(each_steps: int) -> list[Episode]:
    """Instructions that nothing in the state explains."""
    random = np.random.default_rng(3)
    count = -(-STEPS // each_steps)
    return carts(says=random.integers(-1, 2, (80, count)).astype(float).repeat(each_steps, axis=1)[:, :STEPS])


@pytest.mark.parametrize("each_steps", [15, STEPS])
def test_what_the_state_does_not_explain_has_no_delay(each_steps: int):
    found = find_delay(plans(each_steps))
    assert (found.steps, found.known) == (0, False)
    assert found.high > 20


@pytest.mark.parametrize("episodes", [0, 2])
def test_too_little_tells_nothing(episodes: int):
    assert not find_delay(flawed(late_steps=10)[:episodes]).known


def test_silence_throughout_tells_nothing():
    assert find_delay([replace(one, given=np.zeros(STEPS, bool)) for one in carts(5)]) == Delay(0, 0, 0, known=False)
