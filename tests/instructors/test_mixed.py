"""The first row is instructed by one, the others by another, who may go by the first one's habits."""

import numpy as np
import pytest

from ibe_rl.instructors.cloned import ClonedInstructor
from ibe_rl.instructors.mixed import MixedInstructor
from ibe_rl.instructors.taught import told_of
from ibe_rl.types import Array


class Says:
    """Always the same; notes which rows begin and which are asked."""

    def __init__(self, what: float, by: str = "person"):
        self.told = told_of(by)
        self.what, self.begun, self.asked = what, list[list[bool]](), list[list[bool]]()

    def reset(self, rows: Array) -> None:
        self.begun.append(rows.tolist())

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        assert len(states) == len(rows)
        self.asked.append(rows.tolist())
        return np.full((len(rows), 1), self.what, np.float32), np.ones((len(rows), 1), np.float32)


class Remembers(ClonedInstructor):
    """Notes what it is taught instead of learning it."""

    def __init__(self) -> None:
        super().__init__(1)
        self.lessons: list[list[list[float]]] = []

    def learn(self, states: Array, instructions: Array, given: Array) -> None:
        assert len(states) == len(instructions) == len(given)
        self.lessons.append(np.hstack([states, instructions, given]).tolist())


def rows(*which: int) -> Array:
    return np.array(which, bool)


def seen(*values: float) -> Array:
    return np.array(values, np.float32)[:, None]


def test_the_first_row_has_its_own_instructor():
    first, others = Says(1.0), Says(-1.0)
    both = MixedInstructor(first, others)
    both.reset(rows(1, 1, 1))
    instruction, given = both.instruct(seen(0, 0, 0), rows(1, 0, 1))
    assert instruction.tolist() == [[1], [-1], [-1]]
    assert given.tolist() == [[1], [1], [1]]
    assert (instruction.dtype, given.dtype) == (np.float32, np.float32)
    both.reset(rows(0, 1, 0))
    both.instruct(seen(0, 0, 0), rows(0, 1, 1))
    assert (first.begun, first.asked) == ([[True]], [[True], [False]])
    assert (others.begun, others.asked) == ([[True, True], [True, False]], [[False, True], [True, True]])


def test_one_row_has_nobody_beside_it():
    first, others = Says(0.5), Says(-1.0)
    both = MixedInstructor(first, others)
    both.reset(rows(1))
    assert both.instruct(seen(0), rows(1))[0].tolist() == [[0.5]]
    assert (others.begun, others.asked) == ([], [])


def test_habits_are_learnt_from_whole_episodes_of_the_first_row_only():
    others = Remembers()
    both = MixedInstructor(Says(0.5), others)
    both.reset(rows(1, 1))
    for step in range(3):
        both.instruct(seen(step, 90 + step), rows(1, 1))
        both.reset(rows(0, 1))  # another one's episode ends
    assert others.lessons == []
    both.instruct(seen(7, 99), rows(0, 1))  # not asked: no step of the episode
    both.reset(rows(1, 0))
    assert others.lessons == [[[0, 0.5, 1], [1, 0.5, 1], [2, 0.5, 1]]]
    both.reset(rows(1, 1))  # nothing was said since
    both.instruct(seen(4, 95), rows(1, 1))
    both.reset(rows(1, 1))
    assert others.lessons[1:] == [[[4, 0.5, 1]]]


def test_states_are_kept_as_they_were():
    others, states = Remembers(), seen(1, 2)
    both = MixedInstructor(Says(0.5), others)
    both.reset(rows(1, 1))
    both.instruct(states, rows(1, 1))
    states[:] = 9
    both.reset(rows(1, 1))
    assert others.lessons == [[[1, 0.5, 1]]]


@pytest.mark.parametrize("count", [2, 5])
def test_the_others_are_told_what_the_first_was_instructed_before(count: int):
    """In its first episode it was told to go right wherever it is; so are the others in theirs."""
    both = MixedInstructor(Says(1.0), ClonedInstructor(1))
    everybody, places = np.ones(count, bool), np.linspace(-1, 1, 150)
    both.reset(everybody)
    for place in places:
        instruction, given = both.instruct(np.full((count, 1), place, np.float32), everybody)
        assert not instruction[1:].any()
        assert not given[1:].any()
    both.reset(everybody)
    instruction, given = both.instruct(np.zeros((count, 1), np.float32), everybody)
    assert instruction.tolist() == given.tolist() == [[1]] * count


def test_it_tells_who_spoke_in_the_first_row():
    both = MixedInstructor(Says(1.0, by="held"), Says(-1.0))
    both.reset(rows(1, 1, 1))
    assert both.told_rows.tolist() == [[0, 0, 0]] * 3
    both.instruct(seen(0, 0, 0), rows(1, 1, 1))
    assert both.told_rows.tolist() == [[2, 0, 0], [0, 0, 0], [0, 0, 0]]


def test_handed_over_to_the_oracle_it_tells_all_of_them_and_is_nobodys_habit():
    others, oracle, first = Remembers(), Says(0.25), Says(1.0, by="oracle")
    both = MixedInstructor(first, others, oracle)
    both.reset(rows(1, 1))
    assert both.instruct(seen(0, 0), rows(1, 1))[0].tolist() == [[1], [0.25]]
    first.told = told_of("person")
    assert both.instruct(seen(1, 1), rows(1, 1))[0].tolist() == [[1], [0]]
    both.reset(rows(1, 1))
    assert others.lessons == [[[1, 1, 1]]]
