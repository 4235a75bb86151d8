"""What is declared of the BipedalWalker, against the real one."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from ibe_rl.envs import bipedal_walker as walker
from ibe_rl.types import Array


@pytest.fixture(scope="module")
def game() -> Any:
    made: Any = gymnasium.make("BipedalWalker-v3", disable_env_checker=True).unwrapped
    made.reset(seed=1)
    return made


def lying(angle: float, place: float = 50.0) -> Array:
    return np.array([angle, 0.5, 4.0, 0.0, place])


@pytest.mark.parametrize(("angle", "said"), [(0.2, -1), (-0.2, 1), (0.04, 0), (-0.04, 0)])
def test_it_is_told_to_lean_back_upright(angle: float, said: int):
    assert walker.stand_upright(lying(angle)).tolist() == [said]
    assert walker.upright_from_hull(lying(angle)).tolist() == [-angle]


def test_the_end_of_the_course_counts_and_no_fall():
    assert walker.walked_to_the_end(lying(0.0, 89.0), True, False)
    assert not walker.walked_to_the_end(lying(0.0, 89.0), False, True)
    assert not walker.walked_to_the_end(lying(0.0, 88.0), True, False)
    assert not walker.walked_to_the_end(lying(0.0, -0.1), True, False)


def test_the_state_is_that_of_the_hull(game: Any):
    observation, _ = game.reset(seed=1)
    observation, *_ = game.step(np.zeros(4, np.float32))  # it falls to the ground first
    for _ in range(5):
        before = walker.hull_state(game, observation)
        observation, *_ = game.step(np.array([1.0, -1.0, 0.5, 0.0], np.float32))
        state = walker.hull_state(game, observation)
        np.testing.assert_allclose(state[0], observation[0], atol=1e-6)
        np.testing.assert_allclose(state[2:4] * [0.12, 0.08], observation[2:4], atol=1e-5)
        np.testing.assert_allclose(walker.hull_motion(state), state[:1] - before[:1], atol=1e-3)
        np.testing.assert_allclose(state[2] / walker.STEPS_PER_S, state[4] - before[4], atol=1e-3)
