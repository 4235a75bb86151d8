"""The lander told two numbers: states made by hand, and the environment that declares them."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.ibe import phrase


def state(x: float = 0.0, y: float = 0.0, vy: float = 0.0, goal: float = 0.0) -> np.ndarray:
    return np.array([x, y, 0, vy, 0, 0, 0, 0, goal], np.float32)


@pytest.mark.parametrize(
    ("where", "instruction"),
    [
        (state(), [0, 0]),  # it has landed
        (state(x=0.5, y=1, vy=-0.68), [-1, 0]),
        (state(x=-0.9, y=1, vy=-0.68, goal=-0.6), [1, 0]),
        (state(y=1, vy=-0.79), [0, 1]),
        (state(y=1, vy=-0.57), [0, -1]),
        (state(y=0.5, vy=-0.57), [0, 1]),  # what is too slow above is too fast below
        (state(y=-0.3, vy=-0.2), [0, 1]),  # in a valley as on the pad
    ],
)
def test_both_numbers_follow_from_the_state(where: np.ndarray, instruction: list[float]):
    assert LANDER_SPEED_TASK.rule(where).tolist() == instruction
    assert LANDER_SPEED_TASK.rule(np.stack([where, where])).dtype == np.float32
    assert LANDER_SPEED_TASK.rule(where)[:1] == LANDER_TASK.rule(where)


def test_both_are_said_in_one_phrase():
    said = [phrase(np.array(each), LANDER_SPEED_TASK.phrases) for each in ([-1.0, 1], [0, 0], [0.3, -0.5])]
    assert said == [
        "falling to the left and slower",
        "falling straight down and as fast as now",
        "falling slightly to the right and moderately faster",
    ]


def test_what_serves_to_judge_has_a_column_a_number():
    assert LANDER_SPEED_TASK.number_names == ("x", "vy")
    assert LANDER_SPEED_TASK.motion is not None
    assert LANDER_SPEED_TASK.goal_offset is not None
    np.testing.assert_allclose(LANDER_SPEED_TASK.motion(state(vy=-0.5)), [0, 0])
    np.testing.assert_allclose(LANDER_SPEED_TASK.goal_offset(state(x=0.5, y=1, vy=-0.5)), [-0.5, -0.18], atol=1e-6)


def test_the_environment_declares_it_if_asked_to():
    for kwargs, task in (({}, LANDER_TASK), ({"speed": True}, LANDER_SPEED_TASK)):
        env: Any = gymnasium.make(LANDER_ID, disable_env_checker=True, **kwargs)
        assert env.unwrapped.task is task
