"""The reward that agents learn from."""

from __future__ import annotations

from tensordict import TensorDictBase
from torch import Tensor

from ibe_rl.config.settings import AgentConfig


def learning_reward(batch: TensorDictBase, config: AgentConfig) -> Tensor:
    """The environment's reward plus a bonus on success, times ``config.reward_scale``.

    An environment may reward success and failure alike, such as coming to rest in the wrong place.

    Args:
        batch: ``[N, T]`` with ``reward`` and ``success`` ``[N, T, 1]`` under ``next``, and optionally
            ``extra_reward``; not changed.
        config: of the agent.
    """
    after = batch["next"]
    rewards: Tensor = after["reward"] + config.success_bonus * after["success"].float()
    if "extra_reward" in after.keys():  # noqa: SIM118 - a TensorDict
        rewards = rewards + after["extra_reward"]
    return rewards * config.reward_scale
