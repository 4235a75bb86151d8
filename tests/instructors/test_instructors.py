"""Every kind of instructor keeps the protocol; the lander's rule is the paper's equation 7."""

import inspect
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.envs.lander_task import PAD_X
from ibe_rl.instructors import cloned as habits
from ibe_rl.instructors import make_instructor
from ibe_rl.instructors.flawed import FlawedConfig
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.instructors.mixed import OTHER_KINDS
from ibe_rl.instructors.recorded import LessonWriter, RecordedConfig, RecordedEpisode
from ibe_rl.instructors.taught import told_of
from ibe_rl.storage.run_folder import LESSON
from ibe_rl.types import Array, ConfigError, Instructor

KINDS = ("oracle", "silent")
SCRIPT = ((0.0, 0.0), (1.0, 1.0), (1.0, 1.0), (0.0, 1.0), (-1.0, 1.0), (0.0, 0.0), (1.0, 1.0))
ROWS, STEPS = 4, 30


@dataclass(frozen=True)
class Case:
    """An instructor, whether it draws at random, and whether it learns."""

    config: InstructorConfig
    draws: bool = False

    @property
    def learns(self) -> bool:
        return getattr(self.config, "others", None) == "habits"


CASES = {
    **{kind: Case(InstructorConfig(kind)) for kind in KINDS},
    "flawless": Case(FlawedConfig()),
    "late": Case(FlawedConfig(late_steps=3)),
    "always wrong": Case(FlawedConfig(wrong=1.0, spell_steps=2), draws=True),
    "seldom there": Case(FlawedConfig(present=0.4, spell_steps=1), draws=True),
    "all flaws": Case(FlawedConfig(wrong=0.3, late_steps=4, present=0.6, spell_steps=3), draws=True),
    **{f"recorded beside {others}": Case(RecordedConfig(others=others)) for others in OTHER_KINDS},
    **{f"person beside {others}": Case(HumanConfig(others=others)) for others in OTHER_KINDS},
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES)
CERTAIN = {name: case for name, case in CASES.items() if not case.draws}
FORGETFUL = {name: case for name, case in CERTAIN.items() if not case.learns}


class Person:
    """Goes by a script, from the beginning in every episode."""

    told = told_of("person")

    def reset(self, rows: Array) -> None:
        assert rows.tolist() == [True]
        self._step = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        said, given = SCRIPT[self._step % len(SCRIPT)]
        self._step += int(rows[0])
        return np.array([[said]], np.float32), np.array([[given]], np.float32)


@pytest.fixture(autouse=True)
def quick_habits(monkeypatch: pytest.MonkeyPatch) -> None:
    """One episode is enough to learn from."""
    monkeypatch.setattr(habits, "MIN_STEPS", STEPS)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A session of a long and a short episode."""
    writer = LessonWriter(tmp_path / LESSON)
    for number, steps in enumerate((25, 5)):
        said, given = zip(*(SCRIPT[(number + step) % len(SCRIPT)] for step in range(steps)), strict=True)
        by = ["person" if one else "nobody" for one in given]
        episode = RecordedEpisode(number, [[one] for one in said], [int(one) for one in given], by, [0] * steps)
        writer.write(episode)
    return tmp_path


def make(case: Case, recording: Path, seed: int = 0) -> Instructor:
    config = case.config
    if isinstance(config, RecordedConfig):
        config = RecordedConfig(recording=str(recording), others=config.others)
    return make_instructor(config, LANDER_TASK, seed, Person())


def states(count: int, seed: int = 0) -> Array:
    random = np.random.default_rng(seed)
    drawn = random.uniform(-1, 1, (count, 9)).astype(np.float32)
    drawn[:, 8] = random.choice(list(PAD_X.values()), count)
    drawn.flags.writeable = False
    return drawn


def everybody(count: int = ROWS) -> Array:
    return np.ones(count, bool)


def heard(instructor: Instructor, seen: Array, asked: Array) -> Array:
    """What is said ``(T, N, d + 1)`` of states ``(T, N, S)`` to the rows ``(T, N)`` that are asked."""
    return np.stack([np.concatenate(instructor.instruct(*call), axis=1) for call in zip(seen, asked, strict=True)])


@EVERY
def test_every_kind_keeps_the_protocol(case: Case, recording: Path):
    instructor = make(case, recording)
    for name in ("reset", "instruct"):
        asked, has = getattr(Instructor, name), getattr(type(instructor), name)
        assert list(inspect.signature(has).parameters) == list(inspect.signature(asked).parameters)
    kept = []
    for count in (1, 50, 3):
        instructor.reset(everybody(count))
        for step in range(20):
            rows = np.arange(count) % 5 != step % 5
            rows.flags.writeable = False
            instruction, given = instructor.instruct(states(count, step), rows)
            assert instruction.shape == (count, LANDER_TASK.instruction_size)
            assert given.shape == (count, 1)
            assert instruction.dtype == given.dtype == np.float32
            assert np.abs(instruction).max() <= 1
            assert np.isin(given, (0, 1)).all()
            assert not instruction[given[:, 0] == 0].any()
            kept += [(array, array.copy()) for array in (instruction, given)]
            instructor.reset(np.arange(count) % 3 == step % 3)
    assert all(np.array_equal(array, before) for array, before in kept)  # what was said is not written over


@EVERY
def test_the_same_seed_says_the_same(case: Case, recording: Path):
    seen, asked = np.stack([states(ROWS, step) for step in range(STEPS)]), np.ones((STEPS, ROWS), bool)
    for _ in range(2):
        one, other = make(case, recording, seed=5), make(case, recording, seed=5)
        for instructor in (one, other):
            instructor.reset(everybody())
        np.testing.assert_array_equal(heard(one, seen, asked), heard(other, seen, asked))


def paced(case: Case, recording: Path, asked: Array) -> Array:
    """What is said ``(2, STEPS, N, d + 1)`` in two episodes to rows that are asked ``STEPS`` times in each.

    What a row sees at its k-th question does not depend on when that is; in between it sees something else.
    """
    instructor, seen = make(case, recording), np.stack([states(ROWS, 100 + step) for step in range(STEPS)])
    episodes = []
    for _ in range(2):
        instructor.reset(everybody())
        shown = np.stack([states(ROWS, step) for step in range(len(asked))])
        places = [np.flatnonzero(column) for column in asked.T]
        for row, place in enumerate(places):
            shown[place, row] = seen[:, row]
        said = heard(instructor, shown, asked)
        episodes.append(np.stack([said[place, row] for row, place in enumerate(places)], axis=1))
    return np.stack(episodes)


@EVERY
def test_time_stands_still_while_nobody_is_asked(case: Case, recording: Path):
    always = np.ones((STEPS, ROWS), bool)
    now_and_then = np.repeat(np.arange(3 * STEPS) % 3 == 1, ROWS).reshape(-1, ROWS)
    np.testing.assert_array_equal(paced(case, recording, always), paced(case, recording, now_and_then))


@pytest.mark.parametrize("case", CERTAIN.values(), ids=CERTAIN)
def test_the_time_of_a_row_stands_still_while_others_are_asked(case: Case, recording: Path):
    """Those that draw do it for all rows at once, so that other rows that are asked change the draws."""
    always, in_turns = np.ones((STEPS, ROWS), bool), np.add.outer(np.arange(2 * STEPS), np.arange(ROWS)) % 2 == 0
    np.testing.assert_array_equal(paced(case, recording, always), paced(case, recording, in_turns))


@pytest.mark.parametrize("case", CERTAIN.values(), ids=CERTAIN)
def test_a_row_that_is_reset_leaves_the_others_alone(case: Case, recording: Path):
    """That row hears what it heard from its beginning."""
    seen, asked = np.tile(states(ROWS), (STEPS, 1, 1)), np.ones((STEPS, ROWS), bool)
    one, other = make(case, recording), make(case, recording)
    for instructor in (one, other):
        instructor.reset(everybody())
    expected, first = heard(one, seen, asked), heard(other, seen[:11], asked[:11])
    other.reset(np.arange(ROWS) == 1)
    rest = heard(other, seen[11:], asked[11:])
    np.testing.assert_array_equal(np.delete(np.concatenate([first, rest]), 1, axis=1), np.delete(expected, 1, axis=1))
    np.testing.assert_array_equal(rest[:, 1], expected[: len(rest), 1])


@pytest.mark.parametrize("case", FORGETFUL.values(), ids=FORGETFUL)
def test_with_another_number_of_rows_all_of_them_begin(case: Case, recording: Path):
    seen, asked = np.tile(states(7), (STEPS, 1, 1)), np.ones((STEPS, 7), bool)
    used, new = make(case, recording), make(case, recording)
    used.reset(everybody())
    heard(used, seen[:, :ROWS], asked[:, :ROWS])
    for instructor in (used, new):
        instructor.reset(everybody(7))
    np.testing.assert_array_equal(heard(used, seen, asked)[:, 1:], heard(new, seen, asked)[:, 1:])


def test_the_oracle_follows_the_rule_at_every_step():
    instruction, given = make_instructor(InstructorConfig("oracle"), LANDER_TASK).instruct(states(50), everybody(50))
    np.testing.assert_array_equal(instruction, LANDER_TASK.rule(states(50)))
    assert (given == 1).all()
    assert set(instruction[:, 0]) == set(LANDER_TASK.instruction_values)


def test_the_silent_one_says_nothing():
    instruction, given = make_instructor(InstructorConfig("silent"), LANDER_TASK).instruct(states(50), everybody(50))
    assert not instruction.any()
    assert not given.any()


@pytest.mark.parametrize("pad", PAD_X)
@pytest.mark.parametrize(
    ("offset", "instruction"),
    [(-1, 1), (-0.201, 1), (-0.199, 0), (0, 0), (0.199, 0), (0.201, -1), (1, -1)],
)
def test_equation_7(pad: str, offset: float, instruction: float):
    """Right of the right flag: to the left; left of the left flag: to the right; between them: straight down."""
    state = np.zeros(9, np.float32)
    state[[0, 8]] = PAD_X[pad] + offset, PAD_X[pad]
    assert LANDER_TASK.rule(state).tolist() == [instruction]
    many = np.tile(state, (2, 3, 1))
    assert LANDER_TASK.rule(many).shape == (2, 3, 1)


def test_at_a_flag_it_is_straight_down():
    at = np.zeros((2, 9), np.float32)
    at[:, 0] = -0.2, 0.2
    assert LANDER_TASK.rule(at).tolist() == [[0], [0]]


def test_an_unknown_kind_is_refused():
    with pytest.raises(ConfigError, match=r"instructor\.kind=loud: no such kind; allowed is module:Class"):
        make_instructor(InstructorConfig("loud"), LANDER_TASK)
