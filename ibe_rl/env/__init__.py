"""Environments, each with all that is its own; importing this registers them with gymnasium."""

import gymnasium

from ibe_rl.env.instructed import Instructed
from ibe_rl.env.lander_task import LANDER_TASK

LANDER_ID = "ibe_rl/LunarLanderPads-v0"

if LANDER_ID not in gymnasium.registry:
    gymnasium.register(
        id=LANDER_ID,
        entry_point="ibe_rl.env.lander:LunarLanderPads",
        max_episode_steps=LANDER_TASK.max_episode_steps,
        reward_threshold=200,
    )

__all__ = ["LANDER_ID", "LANDER_TASK", "Instructed"]
