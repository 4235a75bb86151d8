"""Double deep Q-learning with n-step returns on TorchRL's replay buffer; the paper's kind of agent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from ibe_rl.agents.actions import Categorical, discrete
from ibe_rl.agents.backward import differentiated
from ibe_rl.agents.encoder import Packing, has_images
from ibe_rl.agents.equivariant import MirroredSpaces, plain_copy, plain_weights
from ibe_rl.agents.exploration import HeldNoise
from ibe_rl.agents.flat_adam import FlatAdam
from ibe_rl.agents.networks import GreedyPolicy, check_finite, linear, make_network
from ibe_rl.agents.reward import learning_reward
from ibe_rl.agents.standardise import RewardStandardiser, Standardiser, standardised
from ibe_rl.config.limits import TINY, setting
from ibe_rl.config.settings import AgentConfig
from ibe_rl.task import Part
from ibe_rl.types import ConfigError


@dataclass
class DQNConfig(AgentConfig):
    """Deep Q-learning with a target network, the paper's kind of agent.

    Over the run the learning rate falls linearly to 0, epsilon from 1 to ``epsilon_early`` to ``epsilon_end``.
    """

    kind: str = setting("dqn", kept=True)
    n_steps: int = setting(5, low=1, high=1_000, kept=True)  # rewards summed before bootstrapping
    buffer_frames: int = setting(400_000, low=1_000, kept=True)  # transitions to draw from
    minibatch_size: int = setting(256, low=1)  # transitions in a gradient step
    frames_per_update: int = setting(10, low=1)  # frames for each gradient step
    learn_after_frames: int = setting(5_000, low=0)  # first frames without learning
    epsilon_early: float = setting(0.1, low=0.0, high=1.0)  # of random actions, once epsilon_share is over
    epsilon_end: float = setting(0.0, low=0.0, high=1.0)  # of random actions, at the end
    epsilon_share: float = setting(0.05, low=0.0, high=1.0)  # share of the run until epsilon_early
    target_rate: float = setting(1.0, low=TINY, high=1.0)  # target update (tau) per batch; 1: a copy


class EpsilonGreedyPolicy(TensorDictModuleBase):
    """Epsilon-greedy actions in one fused module, as ``ppo.SamplingPolicy``.

    ``epsilon`` and ``batch`` are buffers so that they are sent to the collector's processes with the weights.
    """

    epsilon: torch.Tensor
    batch: torch.Tensor

    def __init__(self, network: nn.Module, n_actions: int, start: int = 0, noise_steps: float = 1.0):
        super().__init__()
        self.network, self._n_actions, self._start = network, n_actions, start
        self._held = HeldNoise(noise_steps)
        self.register_buffer("batch", torch.zeros((), dtype=torch.long))
        self.register_buffer("epsilon", torch.ones(()))
        self.in_keys, self.out_keys = ["observation"], ["action"]

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Observations ``(N, O)`` to actions ``(N,)``."""
        best = self.network(tensordict.get("observation")).argmax(-1)
        noise = torch.stack([torch.rand(best.shape), torch.randint_like(best, self._n_actions)], dim=-1)
        explore, other = self._held(noise, int(self.batch)).unbind(-1)
        chosen = torch.where(explore < self.epsilon, other.to(best.dtype), best)
        return tensordict.set("action", chosen + self._start)


def n_step_returns(steps: TensorDictBase, n_steps: int, gamma: float) -> TensorDict:
    """N-step returns of every step with ``n_steps`` in its row, cut at the end of its episode.

    TorchRL's ``MultiStepTransform`` (0.14.1) is not used: it shifts the next observation but not ``terminated``.
    Steps before a terminal state would wrongly bootstrap.

    Args:
        steps: ``[N, T]``, each row one environment without gaps, ``T >= n_steps``.
        n_steps: 1 for the immediate reward and the next observation.
        gamma: discount factor.

    Returns:
        ``(N * (T - n_steps + 1),)``: ``observation``, ``action``, discounted ``reward``, ``later`` (the observation
        to bootstrap from) and its ``discount``, 0 after a terminal state.
    """
    starts = steps.shape[1] - n_steps + 1
    reward, done, terminated = (steps["next", name].squeeze(-1) for name in ("reward", "done", "terminated"))
    ahead = torch.zeros(len(steps), starts, dtype=torch.long)  # index of the last reward summed
    going, total = torch.ones_like(ahead, dtype=torch.bool), torch.zeros(ahead.shape)
    for step in range(n_steps):
        ahead = torch.where(going, step, ahead)
        total += gamma**step * reward[:, step : step + starts] * going
        going = going & ~done[:, step : step + starts]
    rows, last = torch.arange(len(steps))[:, None], torch.arange(starts) + ahead
    returns = {
        "observation": steps["observation"][:, :starts],
        "action": steps["action"][:, :starts],
        "reward": total,
        "later": steps["next", "observation"][rows, last],
        "discount": gamma ** (ahead + 1) * ~terminated[rows, last],
    }
    return TensorDict(returns, ahead.shape).reshape(-1)


class DQN:
    """The learner and its policies.

    Each batch of experience is followed by many gradient steps. Their minibatches and targets are computed at once
    before the first; the target network is updated after the last.

    Args:
        config: see ``DQNConfig``.
        observation_size: O.
        actions: of the environment, discrete.
        total_frames: frames after which the learning rate reaches 0 and epsilon its end.
        ignored: indices of the observation that are hidden from it.
        parts: of the leading numbers of an observation.
        mirror: the mirror image that its network is equivariant under; None: none.

    Attributes:
        policy: explores; run by the collector.
        greedy: evaluated and explained.
    """

    kind, settings = "dqn", DQNConfig

    def __init__(
        self,
        config: DQNConfig,
        observation_size: int,
        actions: gymnasium.Space[Any],
        total_frames: int,
        ignored: Sequence[int] = (),
        parts: Sequence[Part] = (),
        mirror: MirroredSpaces | None = None,
    ):
        self.check(config, actions)
        assert isinstance(actions, gymnasium.spaces.Discrete)
        self._config, self._total_frames, self._frames = config, total_frames, 0
        n_actions, self._start = int(actions.n), int(actions.start)
        self._standardiser = Standardiser(observation_size, parts, config.standardise_observations, mirror)
        self._rewards = RewardStandardiser(config.standardise_rewards, config.gamma)
        self._packing = Packing(observation_size, parts) if has_images(parts) else None
        reads: dict[str, Any] = {"ignored": ignored, "parts": parts, "standardiser": self._standardiser}
        network = make_network(observation_size, config.hidden, n_actions, nn.ReLU, 1.0, mirror=mirror, **reads)
        self._network, self._epsilon = network, 1.0
        self.policy = EpsilonGreedyPolicy(plain_copy(network), n_actions, self._start, config.noise_steps)
        self._acting = plain_copy(network)
        self.greedy = GreedyPolicy(self._acting, config.average_share, Categorical(n_actions, self._start).mode)
        self._target = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(1 - config.target_rate))
        self._pass, self._optimizer = differentiated(network), FlatAdam(network.parameters(), config.learning_rate)
        self._buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(config.buffer_frames))
        self._unfinished: TensorDictBase | None = None  # newest steps, whose n-step return is incomplete

    @staticmethod
    def check(config: DQNConfig, actions: gymnasium.Space[Any]) -> None:
        """Refuse actions that are not discrete.

        Raises:
            ConfigError: naming the actions and what is allowed.
        """
        if not discrete(actions):
            raise ConfigError(
                f"agent={config.kind}: the environment's actions are {actions}, not Discrete; allowed is agent=ppo"
            )

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Store a batch ``[N, T]`` and learn from the buffer; returns the mean loss and epsilon.

        Row i of every batch must be the same environment, continued.

        Raises:
            FloatingPointError: if the loss or the weights are NaN or infinite.
        """
        self._store(batch)
        self._anneal()
        before, self._frames = self._frames, self._frames + batch.numel()
        loss, every = 0.0, self._config.frames_per_update
        updates = self._frames // every - before // every
        if self._frames >= self._config.learn_after_frames and updates and len(self._buffer):
            loss = self._learn(updates)
            check_finite({"q_loss": loss}, self._network.parameters())
            self._target.update_parameters(self._network)
            self._acting.load_state_dict(plain_weights(self._network))
            self.greedy.follow(self._acting)
        return {"q_loss": loss, "epsilon": self._epsilon}

    def _store(self, batch: TensorDictBase) -> None:
        ends = [("next", name) for name in ("observation", "done", "terminated")]
        steps = batch.select("observation", "action", *ends)
        steps["action"] = steps["action"] - self._start
        steps["next", "reward"] = learning_reward(batch, self._config)
        self._standardiser.learn(steps["observation"])
        self._rewards.learn(steps["next", "reward"], steps["next", "done"])
        if self._unfinished is not None:
            steps = torch.cat([self._unfinished, steps], 1)
        whole = max(steps.shape[1] - self._config.n_steps + 1, 0)
        if whole:
            self._buffer.extend(self._packed(n_step_returns(steps, self._config.n_steps, self._config.gamma)))
        self._unfinished = steps[:, whole:].clone()

    def _packed(self, returns: TensorDict) -> TensorDict:
        if self._packing is not None:
            for name in ("observation", "later"):
                returns[name] = TensorDict(self._packing.pack(returns[name]), returns.shape)
        return returns

    def _seen(self, kept: Any) -> Tensor:
        """Observations ``(N, O)`` as drawn from the buffer."""
        seen: Tensor = kept if self._packing is None else self._packing.unpack(kept)
        return seen

    def _anneal(self) -> None:
        config, progress = self._config, self._frames / self._total_frames
        self._optimizer.param_groups[0]["lr"] = linear(config.learning_rate, 0.0, progress)
        turns = (1.0, config.epsilon_early, config.epsilon_end)
        self._epsilon = float(np.interp(progress, (0.0, config.epsilon_share, 1.0), turns))

    def _learn(self, updates: int) -> float:
        size = self._config.minibatch_size
        data = self._buffer.sample(updates * size)
        parts = zip(
            data["observation"].split(size), data["action"].split(size), self._worth(data).split(size), strict=True
        )
        losses = [self._step(*part) for part in parts]
        return torch.stack(losses).mean().item()

    @torch.no_grad()
    def _worth(self, data: TensorDictBase) -> Tensor:
        """Double-DQN targets: the network chooses the next action, the target network values it."""
        later = self._seen(data["later"])
        best = self._network(later).argmax(-1, keepdim=True)
        reward = data["reward"] * self._rewards.factor
        return reward + data["discount"] * self._target.module(later).gather(-1, best).squeeze(-1)

    @torch.no_grad()
    def _step(self, observation: Any, action: Tensor, target: Tensor) -> Tensor:
        (q_values, backward), chosen = self._pass(self._seen(observation)), action[:, None]
        error = q_values.gather(-1, chosen) - target[:, None]
        by_chosen = error.clamp(-1.0, 1.0) / len(error)  # derivative of the Huber loss
        self._optimizer.descend(backward(torch.zeros_like(q_values).scatter_(-1, chosen, by_chosen)))
        return nn.functional.huber_loss(error, torch.zeros_like(error))

    @property
    def standardised(self) -> list[str]:
        """See ``standardise.standardised``."""
        return standardised(self._standardiser, self._rewards)

    def sync_weights(self) -> None:
        """See ``Agent``."""
        self.policy.network.load_state_dict(plain_weights(self._network))
        self.policy.epsilon.fill_(self._epsilon)
        self.policy.batch += 1

    def state_dict(self) -> dict[str, Any]:
        """See ``Agent``."""
        return {
            "network": self._network.state_dict(),
            "target": self._target.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "greedy": self.greedy.state_dict(),
            "frames": self._frames,
            "epsilon": self._epsilon,
            "buffer": self._buffer.state_dict(),
            "rewards": self._rewards.state_dict(),
            "unfinished": None if self._unfinished is None else self._unfinished.to_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""
        for name in ("network", "target", "optimizer", "buffer"):
            getattr(self, f"_{name}").load_state_dict(state[name])
        self.greedy.load_state_dict(state["greedy"])
        self._frames, self._epsilon = state["frames"], state["epsilon"]
        self._rewards.load_state_dict(state.get("rewards"))
        steps = state["unfinished"]
        self._unfinished = None if steps is None else TensorDict(steps, steps["action"].shape[:2])
