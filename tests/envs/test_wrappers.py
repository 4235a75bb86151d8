"""The wrapper says what the rule says, in the order in which every policy here reads it."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from ibe_rl.envs import LANDER_ID, LANDER_TASK, Instructed
from ibe_rl.types import ConfigError


def test_the_instruction_stands_behind_the_state() -> None:
    plain, instructed = gymnasium.make(LANDER_ID), Instructed(gymnasium.make(LANDER_ID))
    state, _ = plain.reset(seed=1, options={"pad": "right"})
    seen, info = instructed.reset(seed=1, options={"pad": "right"})
    for action in [0, 2, 3, 1] * 10:
        np.testing.assert_array_equal(seen, [*state, *LANDER_TASK.rule(state), 1.0])
        assert seen.dtype == np.float32
        state, reward, *ends, _ = plain.step(action)
        seen, *after, info = instructed.step(action)
        assert after == [reward, *ends]
    assert info == {"landed": False}


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_its_spaces_are_those_of_gymnasium() -> None:
    env = Instructed(gymnasium.make(LANDER_ID))
    assert env.observation_space.shape == (LANDER_TASK.observation_size,)
    check_env(env, skip_render_check=True)


def test_what_declares_no_task_is_refused() -> None:
    with pytest.raises(ConfigError, match="declares no task"):
        Instructed(gymnasium.make("CartPole-v1"))
