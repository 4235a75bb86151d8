"""What a model of a person's habits says after having heard them."""

import numpy as np
import pytest

from ibe_rl.instructors import cloned as habits
from ibe_rl.instructors.cloned import ClonedInstructor
from ibe_rl.types import Array


def positions(count: int, seed: int = 0) -> Array:
    """States ``(T, 2)``: where it is, and something that nobody goes by."""
    return np.random.default_rng(seed).uniform(-1, 1, (count, 2)).astype(np.float32)


def person(states: Array) -> tuple[Array, Array]:
    """To the right if it is too far left, to the left if it is too far right, and in between not a word."""
    place = states[:, :1]
    return np.where(place < -0.3, 1.0, np.where(place > 0.3, -1.0, 0.0)).astype(np.float32), abs(place) > 0.3


def taught(*episodes: Array) -> ClonedInstructor:
    made = ClonedInstructor(1)
    for states in episodes:
        made.learn(states, *person(states))
    return made


def says(made: ClonedInstructor, states: Array) -> tuple[Array, Array]:
    return made.instruct(states, np.ones(len(states), bool))


def test_it_learns_a_threshold_and_when_to_be_silent():
    made, states = taught(positions(500)), positions(1_000, seed=1)
    instruction, given = says(made, states)
    right, spoken = person(states)
    near = np.minimum(abs(states[:, 0] - 0.3), abs(states[:, 0] + 0.3)) < 0.03
    np.testing.assert_array_equal(instruction[~near], right[~near])
    np.testing.assert_array_equal(given[~near] > 0, spoken[~near])
    assert 0.2 < spoken.mean() < 0.8


def test_no_instruction_is_not_the_instruction_0():
    states = positions(400)
    silent, still = ClonedInstructor(1), ClonedInstructor(1)
    silent.learn(states, np.zeros((400, 1), np.float32), np.zeros((400, 1), np.float32))
    still.learn(states, np.zeros((400, 1), np.float32), np.ones((400, 1), np.float32))
    assert not np.concatenate(says(silent, states)).any()
    instruction, given = says(still, states)
    assert not instruction.any()
    assert given.all()


def test_before_it_has_heard_enough_it_is_silent():
    few, states = habits.MIN_STEPS // 2, positions(50)
    made = ClonedInstructor(1)
    for part in (0, 1):
        instruction, given = says(made, states)
        assert not np.concatenate([instruction, given]).any()
        assert (instruction.shape, given.shape) == ((50, 1), (50, 1))
        assert instruction.dtype == given.dtype == np.float32
        episode = positions(few, seed=part)
        made.learn(episode, *person(episode))
    assert says(made, states)[1].any()


def test_it_can_say_several_numbers():
    states = positions(400)
    right = np.sign(states)
    made = ClonedInstructor(2)
    made.learn(states, right.astype(np.float32), np.ones((400, 1)))
    instruction, _ = says(made, states)
    assert instruction.shape == (400, 2)
    assert (instruction == right).all(axis=1).mean() > 0.95


def test_it_remembers_the_newest_only(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(habits, "MAX_STEPS", 300)
    made = taught(*(positions(100, seed) for seed in range(20)))
    assert [len(states) for states, _ in made._episodes] == [100] * 3
    np.testing.assert_array_equal(made._episodes[0][0], positions(100, seed=17))
    states = positions(1_000)
    made.learn(states, *person(states))  # however long, the newest is kept whole
    assert [len(seen) for seen, _ in made._episodes] == [1_000]


def test_a_habit_that_was_given_up_is_forgotten():
    made, states = taught(positions(500)), positions(habits.MAX_STEPS, seed=2)
    made.learn(states, *(-one if one.dtype != bool else one for one in person(states)))
    far = np.array([[-0.9, 0], [0.9, 0]], np.float32)
    assert says(made, far)[0].tolist() == [[-1], [1]]


def test_the_same_lessons_teach_the_same():
    one, other, states = taught(positions(500)), taught(positions(500)), positions(300, seed=3)
    np.testing.assert_array_equal(np.hstack(says(one, states)), np.hstack(says(other, states)))
