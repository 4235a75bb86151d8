"""Environments; importing this registers them with gymnasium.

In: the id of an environment, its arguments, and what a config declares of it (``ibe_rl.config.settings.TaskConfig``).
Out: gymnasium environments that declare a ``Task``; many of them as one TorchRL environment with the instruction in the
observation; copies that can be snapshot and restored exactly.
Imports: ``types``, ``task``, ``runtime``, ``storage``, ``config``. No other package knows a particular environment.
"""

import gymnasium

from ibe_rl.envs.cart_pole_task import CART_POLE_TASK
from ibe_rl.envs.lander_task import LANDER_TASK
from ibe_rl.envs.wrappers import Instructed

LANDER_ID, CART_POLE_ID = "ibe_rl/LunarLanderPads-v0", "ibe_rl/CartPoleTarget-v0"

if LANDER_ID not in gymnasium.registry:
    gymnasium.register(
        id=LANDER_ID,
        entry_point="ibe_rl.envs.lander:LunarLanderPads",
        max_episode_steps=LANDER_TASK.max_episode_steps,
        reward_threshold=200,
    )
    gymnasium.register(
        id=CART_POLE_ID,
        entry_point="ibe_rl.envs.cart_pole:CartPoleTarget",
        max_episode_steps=CART_POLE_TASK.max_episode_steps,
    )

__all__ = ["CART_POLE_ID", "CART_POLE_TASK", "LANDER_ID", "LANDER_TASK", "Instructed"]
