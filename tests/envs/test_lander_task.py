"""What the lander declares for baselines and observers, against real flights."""

from typing import Any

import gymnasium
import numpy as np

from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.lander_task import first_contact, lander_goal_offset, lander_motion
from ibe_rl.types import Array


def fall(seed: int, pad: str) -> Array:
    """States of a fall without engines."""
    env: Any = gymnasium.make(LANDER_ID, disable_env_checker=True)
    state, _ = env.reset(seed=seed, options={"pad": pad})
    states, done = [state], False
    while not done:
        state, _, done, *_ = env.step(0)
        states.append(state)
    return np.array(states)


def test_motion_is_the_change_of_x_in_one_step():
    states = fall(3, "left")
    aloft = slice(0, first_contact(states) - 5)
    np.testing.assert_allclose(lander_motion(states[aloft])[:, 0], np.diff(states[:, 0])[aloft], atol=2e-4)
    assert np.abs(lander_motion(states[aloft])).max() > 1e-3


def test_the_goal_is_where_it_is():
    states = fall(0, "right")
    np.testing.assert_allclose(states[:, :1] + lander_goal_offset(states), 0.6, atol=1e-6)


def test_the_first_contact_is_that_of_a_leg():
    states = fall(1, "center")
    step = first_contact(states)
    assert 0 < step <= len(states) - 1
    assert states[step, 6:8].any()
    assert not states[:step, 6:8].any()


def test_who_never_touches_down_is_over_at_the_end():
    assert first_contact(np.zeros((7, 9))) == 6
