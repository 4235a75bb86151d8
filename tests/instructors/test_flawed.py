"""How wrong, late and absent a flawed instructor is, against what was asked for."""

from dataclasses import fields

import numpy as np
import pytest
from scipy.stats import binom

from ibe_rl.instructors.flawed import Flawed, FlawedConfig, corrupted
from ibe_rl.types import Array, Episode

VALUES = (-1.0, 0.0, 1.0)


class Reads:
    """Says what the states say: the instruction, and whether it is given."""

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        given = states[:, -1:].astype(np.float32)
        return states[:, :-1].astype(np.float32) * given, given


def counting(rows: int, steps: int) -> Array:
    """Right values ``(T, N, 2)`` that run through all of them, each row from another one; always given."""
    places = np.add.outer(np.arange(steps), np.arange(rows)) % 3
    return np.stack([np.array(VALUES)[places], np.ones((steps, rows))], axis=-1)


def heard(flaws: FlawedConfig, right: Array, seed: int = 0) -> Array:
    """What is said ``(T, N, 2)`` where ``right`` is."""
    instructor = Flawed(Reads(), VALUES, flaws, seed)
    rows = np.ones(right.shape[1], bool)
    instructor.reset(rows)
    return np.stack([np.concatenate(instructor.instruct(states, rows), axis=1) for states in right])


def within_bounds(count: int, total: int, share: float) -> bool:
    """Whether a count is one of those that a binomial has but once in a million times outside of."""
    low, high = binom.interval(1 - 1e-6, total, share)
    return bool(low <= count <= high)


def test_without_flaws_it_says_what_is_right():
    right = counting(5, 60)
    right[20:30, :, 1] = 0
    expected = right.copy()
    expected[20:30] = 0
    np.testing.assert_array_equal(heard(FlawedConfig(), right), expected)


@pytest.mark.parametrize("late", [1, 2, 7, 40])
def test_late_is_an_exact_shift_with_silence_before(late: int):
    right = counting(4, 40)
    said = heard(FlawedConfig(late_steps=late), right)
    assert not said[:late].any()
    np.testing.assert_array_equal(said[late:], right[: 40 - late])


def test_late_forgets_the_episode_before():
    flaws, right = FlawedConfig(late_steps=3), counting(2, 20)
    instructor = Flawed(Reads(), VALUES, flaws, 0)
    instructor.reset(np.ones(2, bool))
    for step, states in enumerate(right):
        if step == 10:
            instructor.reset(np.array([True, False]))
        instruction, given = instructor.instruct(states, np.ones(2, bool))
        age = [step - 10 if step >= 10 else step, step]
        assert given[:, 0].tolist() == [float(one >= 3) for one in age]
        np.testing.assert_array_equal(instruction[given > 0], right[step - 3, :, :1][given > 0])


@pytest.mark.parametrize("spell", [1, 4])
def test_always_wrong_never_says_the_right_value(spell: int):
    right = counting(30, 60)
    said = heard(FlawedConfig(wrong=1.0, spell_steps=spell), right)
    assert (said[..., 1] == 1).all()
    assert (said[..., 0] != right[..., 0]).all()
    assert np.isin(said[..., 0], VALUES).all()
    for value in VALUES:  # both others, equally often
        instead = said[..., 0][right[..., 0] == value]
        for other in set(VALUES) - {value}:
            assert within_bounds((instead[::spell] == other).sum(), len(instead[::spell]), 0.5)


@pytest.mark.parametrize("wrong", [0.1, 0.5, 0.9])
def test_it_is_wrong_as_often_as_asked(wrong: int):
    right = counting(50, 100)
    said = heard(FlawedConfig(wrong=wrong, spell_steps=1), right)
    assert within_bounds((said[..., 0] != right[..., 0]).sum(), 5_000, wrong)
    spells = heard(FlawedConfig(wrong=wrong, spell_steps=20), right)[..., 0] != right[..., 0]
    assert within_bounds(spells[::20].sum(), 250, wrong)


@pytest.mark.parametrize("present", [0.0, 0.05, 0.5, 0.95])
def test_it_is_there_as_often_as_asked(present: float):
    right = counting(50, 100)
    said = heard(FlawedConfig(present=present, spell_steps=1), right)
    there = said[..., 1] == 1
    assert within_bounds(there.sum(), 5_000, present)
    np.testing.assert_array_equal(said[there], right[there])
    assert not said[~there].any()


def test_all_is_the_same_for_a_spell():
    """Whether it is there, whether it is wrong, and what it says instead of what."""
    right = counting(60, 35)
    said = heard(FlawedConfig(wrong=0.5, present=0.5, spell_steps=10), right)
    for begin in range(0, 35, 10):
        spell, was_right = said[begin : begin + 10], right[begin : begin + 10, :, 0]
        assert np.ptp(spell[..., 1], axis=0).max() == 0
        for row in np.flatnonzero(spell[0, :, 1]):
            pairs = set(zip(was_right[:, row], spell[:, row, 0], strict=True))
            assert len(pairs) == len({one for one, _ in pairs})
            assert len({one == other for one, other in pairs}) == 1
    lasting = (said[:30:10, :, 1] == said[10:40:10, :, 1]).mean()
    assert 0.3 < lasting < 0.7  # of 180 spells, about half are like the one before


def test_rows_are_drawn_each_by_itself():
    said = heard(FlawedConfig(wrong=0.5, spell_steps=1), np.tile(counting(1, 200), (1, 40, 1)))
    assert within_bounds((said[:, 0] == said[:, 1])[:, 0].sum(), 200, 0.5 * 0.5 + 0.5 * 0.5 * 0.5)
    assert len(np.unique(said[..., 0].T, axis=0)) == 40


def test_a_row_that_begins_leaves_the_spells_of_others_alone():
    """It draws one for itself, in the middle of theirs."""
    flaws, rows, right = FlawedConfig(wrong=0.5, present=0.5, spell_steps=100), np.ones(60, bool), counting(60, 1)[0]
    instructor = Flawed(Reads(), VALUES, flaws, 0)
    instructor.reset(rows)
    before = np.hstack(instructor.instruct(right, rows))
    begins = np.arange(60) < 30
    instructor.reset(begins)
    after = np.hstack(instructor.instruct(right, rows))
    np.testing.assert_array_equal(after[~begins], before[~begins])
    assert (after[begins] != before[begins]).any()


def test_silence_stays_silence():
    right = counting(50, 60)
    right[..., 1] = np.random.default_rng(0).random((60, 50)) < 0.5
    said = heard(FlawedConfig(wrong=1.0, late_steps=2), right)
    np.testing.assert_array_equal(said[2:, :, 1], right[:-2, :, 1])
    assert not said[said[..., 1] == 0].any()


def test_the_same_seed_draws_the_same():
    flaws, right = FlawedConfig(wrong=0.4, late_steps=2, present=0.6, spell_steps=3), counting(10, 50)
    np.testing.assert_array_equal(heard(flaws, right, seed=3), heard(flaws, right, seed=3))
    assert (heard(flaws, right, seed=3) != heard(flaws, right, seed=4)).any()


def episode(number: int, steps: int) -> Episode:
    """With what is right in it, and silence now and then."""
    random = np.random.default_rng(number)
    given = random.random(steps) < 0.8
    instruction = random.choice(VALUES, (steps, 1)).astype(np.float32) * given[:, None]
    states = random.normal(size=(steps + 1, 3)).astype(np.float32)
    rewards = random.normal(size=steps).astype(np.float32)
    return Episode(
        states, random.integers(0, 4, steps), rewards, instruction, given, number % 2 == 0, number == 1, "left"
    )


FLAWS = [
    FlawedConfig(),
    FlawedConfig(late_steps=5),
    FlawedConfig(wrong=0.5, spell_steps=1),
    FlawedConfig(wrong=0.3, late_steps=3, present=0.5, spell_steps=4),
]


@pytest.mark.parametrize("flaws", FLAWS)
def test_corrupted_episodes_are_what_the_flawed_one_would_have_said(flaws: FlawedConfig):
    episodes = [episode(number, steps) for number, steps in enumerate((12, 30, 1, 19))]
    made = corrupted(episodes, VALUES, flaws, seed=9)
    instructor = Flawed(Reads(), VALUES, flaws, seed=9)
    instructor.reset(np.ones(4, bool))
    for step in range(30):
        rows = np.array([step < len(one) for one in episodes])
        right = np.array(
            [[*one.instructions[step], one.given[step]] if step < len(one) else [0, 0] for one in episodes]
        )
        instruction, given = instructor.instruct(right, rows)
        for row in np.flatnonzero(rows):
            assert made[row].instructions[step] == instruction[row]
            assert made[row].given[step] == (given[row, 0] > 0)


def test_corrupted_episodes_keep_all_the_rest():
    episodes = [episode(number, steps) for number, steps in enumerate((12, 30))]
    for one, other in zip(corrupted(episodes, VALUES, FLAWS[-1], seed=0), episodes, strict=True):
        for item in fields(Episode):
            if item.name in ("instructions", "given"):
                assert getattr(one, item.name).dtype == getattr(other, item.name).dtype
                assert (getattr(one, item.name) != getattr(other, item.name)).any()
            else:
                np.testing.assert_array_equal(getattr(one, item.name), getattr(other, item.name))


def test_without_flaws_nothing_is_corrupted():
    [before] = episodes = [episode(1, 40)]
    [after] = corrupted(episodes, VALUES, FlawedConfig(), seed=0)
    np.testing.assert_array_equal(after.instructions, before.instructions)
    np.testing.assert_array_equal(after.given, before.given)


@pytest.mark.parametrize(("late", "expected"), [(0, "0++++---00+."), (2, "..0++++---00")])
def test_a_key_that_is_kept_down_lasts_until_another_one(late: int, expected: str):
    numbers = np.array([0, 1, 1, 0, 0, -1, 0, 0, 0, 0, 1, 0], float)
    right = np.stack([numbers, np.ones(12)], axis=1)[:, None]
    right[11, 0] = 0  # silence is no 0 to be said
    said = heard(FlawedConfig(lasting_steps=2, late_steps=late), right)[:, 0]
    assert "".join("." if not given else "-0+"[int(value) + 1] for value, given in said) == expected


def test_a_new_episode_begins_with_no_key_down():
    instructor = Flawed(Reads(), VALUES, FlawedConfig(lasting_steps=5), 0)
    rows = np.array([True])
    instructor.reset(rows)
    assert instructor.instruct(np.array([[1.0, 1.0]]), rows)[0] == 1
    instructor.reset(rows)
    assert instructor.instruct(np.array([[0.0, 1.0]]), rows)[0] == 0
