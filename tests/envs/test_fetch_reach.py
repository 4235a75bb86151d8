"""What is declared of FetchReach, against the real arm."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.envs import fetch_reach
from ibe_rl.types import Array

RIGHT, UP, AHEAD = np.eye(3)


@pytest.fixture(scope="module")
def arm() -> Any:
    env: Any = gymnasium.make("gymnasium_robotics:FetchReachDense-v4", disable_env_checker=True)
    env.reset(seed=3)
    return env


def moved(arm: Any, *action: float) -> tuple[Array, Array]:
    """States before and after six steps of an action: ahead, to the left, up, and the gripper's fingers."""
    before = fetch_reach.gripper_state(arm.unwrapped, arm.reset(seed=3)[0])
    for _ in range(6):
        observation, *_ = arm.step(np.array(action, np.float32))
    return before, fetch_reach.gripper_state(arm.unwrapped, observation)


def test_the_instruction_points_from_the_gripper_to_the_goal():
    states = np.zeros((3, 6))
    states[:, :3] = [(0.1, -0.1, 0.04), (0.02, 0.04, -0.02), (-0.04, 0.0, -0.1)]
    np.testing.assert_array_equal(fetch_reach.towards_goal(states), [(-1, 1, -1), (0, -1, 0), (1, 0, 1)])
    np.testing.assert_array_equal(fetch_reach.goal_from_gripper(states), -states[:, :3])


@pytest.mark.parametrize(
    ("action", "way"), [((0, -1, 0, 0), RIGHT), ((0, 0, 1, 0), UP), ((1, 0, 0, 0), AHEAD)], ids=["right", "up", "ahead"]
)
def test_each_component_rises_in_its_direction(arm: Any, action: tuple[float, ...], way: Array):
    before, after = moved(arm, *action)
    went = after[:3] - before[:3]
    assert went @ way > 0.1
    assert np.abs(went * (1 - way)).max() < 0.03


def test_the_velocity_goes_where_the_gripper_goes(arm: Any):
    _, state = moved(arm, 0, -1, 0, 0)
    later = fetch_reach.gripper_state(arm.unwrapped, arm.step(np.array([0, -1, 0, 0], np.float32))[0])
    went = later[:3] - state[:3]
    assert 0.5 * went[0] < fetch_reach.gripper_motion(state)[0] < went[0]  # less within a step than over it
    assert np.abs(fetch_reach.gripper_motion(state)[1:]).max() < 2e-3


def test_the_gripper_is_drawn_where_the_path_says(arm: Any):
    observation, _ = arm.reset(seed=3)
    state = fetch_reach.gripper_state(arm.unwrapped, observation)
    drawn = fetch_reach.gripper_disc(arm.unwrapped)[0].points.mean(axis=0)
    np.testing.assert_allclose(drawn, fetch_reach.seen_from_behind(state), atol=1e-5)
    np.testing.assert_allclose(fetch_reach.goal_disc(arm.unwrapped)[0].points.mean(axis=0), [8, 8], atol=1e-9)
