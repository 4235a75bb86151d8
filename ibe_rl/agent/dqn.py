"""Deep Q-learning on TorchRL's loss and replay buffer: the paper's kind of agent."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from ibe_rl.agent.networks import GreedyPolicy, linear, make_network
from ibe_rl.config import DQNConfig


class EpsilonGreedyPolicy(TensorDictModuleBase):
    """Mostly the best action, with probability ``epsilon`` any; one fused module as in ``ppo.SamplingPolicy``.

    ``epsilon`` is a buffer of the module, so that it reaches the collector's processes with the weights.
    """

    epsilon: torch.Tensor

    def __init__(self, network: nn.Module, n_actions: int):
        super().__init__()
        self.network, self._n_actions = network, n_actions
        self.register_buffer("epsilon", torch.ones(()))
        self.in_keys, self.out_keys = ["observation"], ["action"]

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Observations ``(N, O)`` to actions ``(N,)``."""
        best = self.network(tensordict.get("observation")).argmax(-1)
        explore = torch.rand(best.shape) < self.epsilon
        return tensordict.set("action", torch.where(explore, torch.randint_like(best, self._n_actions), best))


class DQN:
    """The learner and its policies.

    Args:
        config: see ``DQNConfig``.
        observation_size: O.
        n_actions: A.
        total_frames: length of the run, over a share of which epsilon falls.

    Attributes:
        policy: what the collector runs; it explores.
        greedy: what is evaluated and explained.
    """

    def __init__(self, config: DQNConfig, observation_size: int, n_actions: int, total_frames: int):
        self._config, self._total_frames, self._frames = config, total_frames, 0
        network = make_network(observation_size, config.hidden, n_actions, nn.ReLU, last_gain=1.0)
        self._network, self.policy = network, EpsilonGreedyPolicy(network, n_actions)
        self.greedy = GreedyPolicy(network, config.average_decay)
        actor = QValueActor(network, in_keys=["observation"], action_space="categorical")
        self._loss = DQNLoss(
            actor, loss_function="smooth_l1", delay_value=True, double_dqn=True, action_space="categorical"
        )
        self._loss.make_value_estimator(gamma=config.gamma)
        self._target = SoftUpdate(self._loss, tau=config.target_rate)
        self._optimizer = torch.optim.Adam(self._loss.parameters(), lr=config.learning_rate, fused=True)
        self._buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(config.buffer_frames), batch_size=config.minibatch_size
        )

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Take in a batch ``[N, T]`` and learn from the buffer; returns the mean loss and epsilon."""
        self._store(batch)
        self._anneal()
        before, self._frames = self._frames, self._frames + batch.numel()
        losses = []
        if self._frames >= self._config.learn_after_frames:
            every = self._config.frames_per_update
            losses = [self._step() for _ in range(self._frames // every - before // every)]
            self.greedy.follow(self._network)
        return {"q_loss": sum(losses) / max(len(losses), 1), "epsilon": self.policy.epsilon.item()}

    def _store(self, batch: TensorDictBase) -> None:
        ends = [("next", name) for name in ("observation", "reward", "done", "terminated")]
        data = batch.select("observation", "action", *ends).reshape(-1)
        data["next", "reward"] = data["next", "reward"] * self._config.reward_scale
        self._buffer.extend(data)

    def _anneal(self) -> None:
        progress = self._frames / (self._config.epsilon_share * self._total_frames + 1)
        self.policy.epsilon.fill_(linear(1.0, self._config.epsilon_end, progress))

    def _step(self) -> float:
        loss = self._loss(self._buffer.sample())["loss"]
        loss.backward()
        nn.utils.clip_grad_norm_(self._loss.parameters(), self._config.max_grad_norm)
        self._optimizer.step()
        self._optimizer.zero_grad()
        self._target.step()
        return float(loss.item())

    def state_dict(self) -> dict[str, Any]:
        """All that learning goes on from, but for the buffer."""
        return {
            "loss": self._loss.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "greedy": self.greedy.state_dict(),
            "frames": self._frames,
        }
