"""Proximal policy optimisation on TorchRL's loss and advantage estimate."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase
from torch import nn
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from ibe_rl.agent.networks import GreedyPolicy, linear, make_network
from ibe_rl.config import PPOConfig


class SamplingPolicy(TensorDictModuleBase):
    """Draws actions and writes their log-probabilities: one fused module, half the cost of a chain of modules."""

    def __init__(self, network: nn.Module):
        super().__init__()
        self.network = network
        self.in_keys, self.out_keys = ["observation"], ["action", "action_log_prob"]

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Observations ``(N, O)`` to actions ``(N,)`` and log-probabilities ``(N,)``."""
        log_probs = self.network(tensordict.get("observation")).log_softmax(-1)
        action = torch.multinomial(log_probs.exp(), 1)
        tensordict.set("action", action.squeeze(-1))
        return tensordict.set("action_log_prob", log_probs.gather(-1, action).squeeze(-1))


class PPO:
    """The learner and its policies.

    Args:
        config: see ``PPOConfig``.
        observation_size: O.
        n_actions: A.
        total_frames: frames after which learning rate and entropy bonus reach 0.

    Attributes:
        policy: what the collector runs; it explores.
        greedy: what is evaluated and explained.
    """

    def __init__(self, config: PPOConfig, observation_size: int, n_actions: int, total_frames: int):
        self._config, self._total_frames, self._frames = config, total_frames, 0
        actor = make_network(observation_size, config.hidden, n_actions, nn.Tanh, last_gain=0.01)
        critic = make_network(observation_size, config.hidden, 1, nn.Tanh, last_gain=1.0)
        self._actor, self.policy, self.greedy = actor, SamplingPolicy(actor), GreedyPolicy(actor, config.average_decay)
        value = ValueOperator(critic, in_keys=["observation"])
        self._loss = ClipPPOLoss(
            ProbabilisticActor(
                TensorDictModule(actor, in_keys=["observation"], out_keys=["logits"]),
                in_keys=["logits"],
                distribution_class=torch.distributions.Categorical,
                return_log_prob=True,
            ),
            value,
            clip_epsilon=config.clip,
            entropy_coeff=config.entropy,
            critic_coeff=config.value_weight,
            normalize_advantage=True,
            loss_critic_type="l2",
        )
        self._advantage = GAE(gamma=config.gamma, lmbda=config.gae_lambda, value_network=value)
        self._optimizer = torch.optim.Adam(self._loss.parameters(), lr=config.learning_rate, eps=1e-5, fused=True)

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from a batch ``[N, T]``; returns the last minibatch's losses."""
        self._anneal()
        self._frames += batch.numel()
        steps = self._prepare(batch)
        for _ in range(self._config.epochs):
            for rows in torch.randperm(len(steps)).split(self._config.minibatch_size):
                losses = self._step(steps[rows])
        self.greedy.follow(self._actor)
        return losses

    def _anneal(self) -> None:
        progress = self._frames / self._total_frames
        self._optimizer.param_groups[0]["lr"] = linear(self._config.learning_rate, 0.0, progress)
        self._loss.entropy_coeff.fill_(linear(self._config.entropy, 0.0, progress))

    def _prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """Add advantages, which need whole rows of time, then forget which row a step came from."""
        ends = [("next", name) for name in ("observation", "reward", "done", "terminated")]
        data = batch.select("observation", "action", "action_log_prob", *ends)
        data["next", "reward"] = data["next", "reward"] * self._config.reward_scale
        with torch.no_grad():
            self._advantage(data)
        return data.select("observation", "action", "action_log_prob", "advantage", "value_target").reshape(-1)

    def _step(self, minibatch: TensorDictBase) -> dict[str, float]:
        losses = self._loss(minibatch)
        total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
        total.backward()
        nn.utils.clip_grad_norm_(self._loss.parameters(), self._config.max_grad_norm)
        self._optimizer.step()
        self._optimizer.zero_grad()
        return {"policy_loss": losses["loss_objective"].item(), "value_loss": losses["loss_critic"].item()}

    def state_dict(self) -> dict[str, Any]:
        """All that learning goes on from."""
        return {
            "loss": self._loss.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "greedy": self.greedy.state_dict(),
            "frames": self._frames,
        }
