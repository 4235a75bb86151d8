"""Held exploration noise: what is as probable as before, and what goes together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import nn

from ibe_rl.agents.actions import Categorical
from ibe_rl.agents.dqn import EpsilonGreedyPolicy
from ibe_rl.agents.ppo import SamplingPolicy


class Indifferent(nn.Module):
    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return torch.zeros(len(observation), 4)


def sampling(noise_steps: float) -> Any:
    return SamplingPolicy(Indifferent(), Categorical(4), noise_steps)


def epsilon_greedy(noise_steps: float) -> Any:
    return EpsilonGreedyPolicy(Indifferent(), 4, noise_steps=noise_steps)  # epsilon is 1 at first


KINDS = pytest.mark.parametrize("make", [sampling, epsilon_greedy])


def explored(policy: Any, steps: int, batches: int = 1) -> torch.Tensor:
    """Actions ``(batches * steps, 400)`` in 400 environments; all four actions are as good."""
    torch.manual_seed(0)
    drawn = []
    for _ in range(batches):
        drawn += [policy(TensorDict({"observation": torch.zeros(400, 1)}, [400]))["action"] for _ in range(steps)]
        policy.batch += 1
    return torch.stack(drawn)


@KINDS
@pytest.mark.parametrize(("noise_steps", "kept"), [(1.0, 0.25), (2.0, 0.625), (10.0, 0.925)])
def test_held_noise_repeats_actions_and_leaves_them_as_probable(
    make: Callable[[float], Any], noise_steps: float, kept: float
) -> None:
    actions = explored(make(noise_steps), 300)
    assert (actions[1:] == actions[:-1]).float().mean().item() == pytest.approx(kept, abs=0.01)  # 1 - 3/4 of new ones
    shares = torch.bincount(actions.flatten()) / actions.numel()
    assert shares.tolist() == pytest.approx(4 * [0.25], abs=0.015)


@KINDS
def test_each_batch_begins_with_new_noise(make: Callable[[float], Any]) -> None:
    """So that a resumed run, which begins with a batch, explores as an uninterrupted one."""
    actions = explored(make(1000.0), 5, batches=2)
    assert (actions[:5] == actions[0]).float().mean() > 0.99
    assert (actions[5] == actions[4]).float().mean().item() == pytest.approx(0.25, abs=0.08)


def test_whether_to_explore_is_held_with_the_action() -> None:
    policy = epsilon_greedy(10.0)
    policy.epsilon.fill_(0.2)
    actions = explored(policy, 400)
    assert (actions != 0).float().mean().item() == pytest.approx(0.2 * 0.75, abs=0.01)
    began = (actions[:-1] == 0) & (actions[1:] != 0)
    assert began.float().mean().item() == pytest.approx(0.1 * 0.15 * 0.85, abs=0.003)
