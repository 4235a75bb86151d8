"""Agents that were not trained here, for tests: functions, modules and models of other libraries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.envs.box2d.lunar_lander import heuristic
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from tensordict.nn import TensorDictModule

from ibe_rl.envs import LANDER_ID, Instructed

GAME: Any = SimpleNamespace(unwrapped=SimpleNamespace(continuous=False))


def pilot(state: np.ndarray) -> int:
    """The game's own pilot, steering for the pad: one state to one action."""
    seen = state[:8].copy()
    seen[0] -= state[8]
    return int(heuristic(GAME, seen))


def sideways(observations: np.ndarray) -> np.ndarray:
    """States ``(N, 9)`` to actions ``(N,)``: an engine towards the pad."""
    return np.where(observations[:, 8] > observations[:, 0], 3, 1)


def obedient(observations: np.ndarray) -> np.ndarray:
    """Observations ``(N, 11)`` to actions ``(N,)``: an engine in the direction that was said."""
    return np.array([1, 2, 3])[observations[:, 9].astype(int) + 1]


def reach(states: np.ndarray) -> np.ndarray:
    """States ``(N, 10)`` of the Reacher to torques ``(N, 2)``: pulls the fingertip to the target, and brakes."""
    tip = states[:, 4:6] + states[:, 8:10]
    elbow = 0.1 * states[:, [0, 2]]
    pull = -20 * states[:, 8:10]
    torques = [pull[:, 1] * arm[:, 0] - pull[:, 0] * arm[:, 1] for arm in (tip, tip - elbow)]
    return np.clip(np.stack(torques, axis=1) - 0.03 * states[:, 6:8], -1, 1).astype(np.float32)


SPACE = gymnasium.make(LANDER_ID).observation_space


def module(outputs: int = 4, inputs: int = 9) -> TensorDictModule:
    """A policy of TorchRL: one output an action, one-hot."""
    torch.manual_seed(0)
    net = torch.nn.Sequential(torch.nn.Linear(inputs, outputs), torch.nn.Dropout(0.9), OneHot())
    return TensorDictModule(net, ["observation"], ["action"])


class OneHot(torch.nn.Module):
    """The highest output as one-hot integers."""

    def forward(self, outputs: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.one_hot(outputs.argmax(-1), outputs.shape[-1])


def trained(kind: str, instructed: bool = False) -> BaseAlgorithm:
    """A model that stable-baselines3 has trained for a few seconds."""
    torch.set_num_threads(1)
    env = Instructed(gymnasium.make(LANDER_ID)) if instructed else gymnasium.make(LANDER_ID)
    net = {"net_arch": [16]}
    if kind == "PPO":
        return PPO("MlpPolicy", env, n_steps=256, seed=0, policy_kwargs=net, device="cpu").learn(512)
    model = DQN("MlpPolicy", env, buffer_size=2_000, learning_starts=100, seed=0, policy_kwargs=net, device="cpu")
    return model.learn(400)
