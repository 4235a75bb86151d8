"""What is declared of the Reacher, against the real arm."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.envs import reacher
from ibe_rl.types import Array


@pytest.fixture(scope="module")
def moved() -> tuple[Any, Array]:
    env: Any = gymnasium.make("Reacher-v5", disable_env_checker=True)
    state, _ = env.reset(seed=3)
    env.action_space.seed(0)
    states = [state, *(env.step(0.05 * env.action_space.sample())[0] for _ in range(50))]
    return env.unwrapped, np.array(states)


def test_the_instruction_points_from_the_fingertip_to_the_target():
    states = np.zeros((3, 10))
    states[:, 8:] = [(0.1, -0.1), (0.01, 0.03), (-0.01, 0.0)]
    np.testing.assert_array_equal(reacher.instruct(states), [(-1, 1), (0, -1), (0, 0)])
    np.testing.assert_array_equal(reacher.goal_offset(states), -states[:, 8:])


def test_reached_is_near_at_the_end_of_the_time():
    state = np.zeros(10)
    state[8:] = 0.02, 0.02
    assert reacher.reached(state, False, True)
    assert not reacher.reached(state, False, False)
    state[8] = 0.03
    assert not reacher.reached(state, False, True)


def test_the_quadrant_is_the_targets():
    states = np.zeros((4, 10))
    states[:, 4:6] = [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    assert [reacher.quadrant(state) for state in states] == ["lower left", "upper left", "lower right", "upper right"]


def test_the_motion_is_that_of_the_fingertip(moved: tuple[Any, Array]):
    _, states = moved
    really = np.diff(states[:, 4:6] + states[:, 8:10], axis=0)
    assert np.abs(really).max() > 3e-4
    now = reacher.motion(states)
    np.testing.assert_allclose((now[1:] + now[:-1]) / 2, really, atol=2e-5)


def test_the_drawing_has_the_fingertip_where_the_path_says(moved: tuple[Any, Array]):
    game, states = moved
    np.testing.assert_allclose(reacher.figure(game)[0].points[-1], reacher.scene_path(states[-1]), atol=1e-5)
    middle = reacher.background(game)[0].points.mean(axis=0)
    np.testing.assert_allclose(middle, 3 + 10 * states[-1, 4:6], atol=1e-6)
