"""Agents on TorchRL's parts; they know observations and actions, no environment."""

from __future__ import annotations

from typing import Any, Protocol

import gymnasium
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from ibe_rl.agent.dqn import DQN
from ibe_rl.agent.networks import GreedyPolicy
from ibe_rl.agent.ppo import PPO
from ibe_rl.config import AgentConfig, DQNConfig, PPOConfig
from ibe_rl.data import ConfigError


class Agent(Protocol):
    """A learner: ``policy`` explores and is what the collector runs, ``greedy`` is what is explained."""

    policy: TensorDictModuleBase
    greedy: GreedyPolicy

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from a batch ``[N, T]``; returns figures for the log, the same names every time."""

    def publish(self) -> None:
        """Let ``policy`` have what has been learnt; not while it collects, which would not be repeatable."""

    def state_dict(self) -> dict[str, Any]:
        """All that learning goes on from."""


def make_agent(config: AgentConfig, observation_size: int, actions: gymnasium.Space[Any], total_frames: int) -> Agent:
    """Make the agent of the kind that ``config`` is of.

    Raises:
        ConfigError: if the environment's actions are not discrete, or the config is of no known kind.
    """
    if not isinstance(actions, gymnasium.spaces.Discrete):
        raise ConfigError(f"env: its actions are {actions}; the agents here need a Discrete space")
    if isinstance(config, PPOConfig):
        return PPO(config, observation_size, int(actions.n), total_frames)
    if isinstance(config, DQNConfig):
        return DQN(config, observation_size, int(actions.n), total_frames)
    raise ConfigError(f"agent={type(config).__name__}: allowed is one of PPOConfig, DQNConfig")


__all__ = ["DQN", "PPO", "Agent", "GreedyPolicy", "make_agent"]
