"""Every kind of instructor keeps the protocol; the lander's rule is the paper's equation 7."""

import inspect
from dataclasses import fields

import numpy as np
import pytest

from ibe_rl.config import InstructorConfig
from ibe_rl.data import Array, ConfigError, Instructor
from ibe_rl.env import LANDER_TASK
from ibe_rl.env.lander_task import PAD_X
from ibe_rl.instruct import make_instructor

KINDS = fields(InstructorConfig)[0].metadata["choices"]


def states(count: int) -> Array:
    random = np.random.default_rng(0)
    drawn = random.uniform(-1, 1, (count, 9)).astype(np.float32)
    drawn[:, 8] = random.choice(list(PAD_X.values()), count)
    drawn.flags.writeable = False
    return drawn


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_keeps_the_protocol(kind: str):
    instructor: Instructor = make_instructor(InstructorConfig(kind), LANDER_TASK)
    for name in ("reset", "instruct"):
        asked, has = getattr(Instructor, name), getattr(type(instructor), name)
        assert list(inspect.signature(has).parameters) == list(inspect.signature(asked).parameters)
    for count in (1, 50, 3):
        instructor.reset(np.ones(count, bool))
        for step in range(20):
            instruction, given = instructor.instruct(states(count), np.ones(count, bool))
            assert instruction.shape == (count, LANDER_TASK.instruction_size)
            assert given.shape == (count, 1)
            assert instruction.dtype == given.dtype == np.float32
            assert np.abs(instruction).max() <= 1
            assert np.isin(given, (0, 1)).all()
            assert not instruction[given[:, 0] == 0].any()
            instructor.reset(np.arange(count) % 3 == step % 3)


def test_the_oracle_follows_the_rule_at_every_step():
    instruction, given = make_instructor(InstructorConfig("oracle"), LANDER_TASK).instruct(
        states(50), np.ones(50, bool)
    )
    np.testing.assert_array_equal(instruction, LANDER_TASK.rule(states(50)))
    assert (given == 1).all()
    assert set(instruction[:, 0]) == set(LANDER_TASK.instruction_values)


def test_the_silent_one_says_nothing():
    instruction, given = make_instructor(InstructorConfig("silent"), LANDER_TASK).instruct(
        states(50), np.ones(50, bool)
    )
    assert not instruction.any()
    assert not given.any()


def test_an_unknown_kind_is_refused():
    with pytest.raises(ConfigError, match=r"instructor\.kind=loud: allowed is one of " + ", ".join(KINDS)):
        make_instructor(InstructorConfig("loud"), LANDER_TASK)


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
