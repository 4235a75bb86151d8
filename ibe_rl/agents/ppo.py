"""Proximal policy optimisation with TorchRL's generalised advantage estimate.

The loss and its derivatives are written out: with networks this small, ``torchrl.objectives.ClipPPOLoss`` and
autograd take several times as long a step (docs/LOG.md). A test checks that all are equal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.modules import ValueOperator
from torchrl.objectives.value import GAE

from ibe_rl.agents.actions import Actions, make_actions
from ibe_rl.agents.backward import differentiated
from ibe_rl.agents.equivariant import MirroredSpaces, plain_copy, plain_weights
from ibe_rl.agents.exploration import HeldNoise
from ibe_rl.agents.flat_adam import FlatAdam
from ibe_rl.agents.networks import GreedyPolicy, check_finite, make_network
from ibe_rl.agents.reward import learning_reward
from ibe_rl.agents.standardise import RewardStandardiser, Standardiser, standardised
from ibe_rl.config.limits import TINY, setting
from ibe_rl.config.settings import AgentConfig
from ibe_rl.task import Part


@dataclass
class PPOConfig(AgentConfig):
    """Proximal policy optimisation; learning rate and entropy bonus fall linearly to 0 over the run."""

    kind: str = setting("ppo", kept=True)
    gae_lambda: float = setting(0.98, low=0.0, high=1.0)  # of generalised advantage estimation
    clip: float = setting(0.2, low=1e-6, high=1.0)  # largest change of a probability ratio that counts
    epochs: int = setting(4, low=1)  # passes over each batch
    minibatch_size: int = setting(512, low=2)  # steps in a gradient step
    entropy: float = setting(0.004, low=0.0)  # weight of the entropy bonus
    first_std: float = setting(0.6, low=TINY, high=10.0)  # initial, of continuous actions, in half ranges
    value_weight: float = setting(0.5, low=0.0)  # of the value loss
    max_grad_norm: float = setting(0.5, low=TINY)  # gradients are scaled down to this norm


class SamplingPolicy(TensorDictModuleBase):
    """Samples actions and writes log-probabilities in one fused module, half the cost of a chain of modules.

    Args:
        network: observations to the outputs of a distribution.
        actions: the distribution.
        noise_steps: see ``HeldNoise``.

    Attributes:
        batch: number of the batch, counted by the learner. The processes that collect share it and do not write to it.
    """

    batch: Tensor

    def __init__(self, network: nn.Module, actions: Actions, noise_steps: float = 1.0):
        super().__init__()
        self.network, self._actions = network, actions
        self._held = HeldNoise(noise_steps) if noise_steps > 1 else None
        self.register_buffer("batch", torch.zeros((), dtype=torch.long))
        self.in_keys = ["observation"]
        self.out_keys = list(dict.fromkeys(["action", "action_log_prob", actions.learnt_from]))

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Observations ``(N, O)`` to actions ``(N,)`` or ``(N, A)`` and log-probabilities ``(N,)``."""
        outputs = self.network(tensordict.get("observation"))
        noise = self._held(self._actions.noise(outputs), int(self.batch)) if self._held else None
        for key, value in self._actions.draw(outputs, noise).items():
            tensordict.set(key, value)
        return tensordict


class PPOSteps(NamedTuple):
    """``B`` steps to learn from.

    Attributes:
        observation: ``(B, O)``.
        drawn: ``(B,)`` int64 or ``(B, A)``, sampled actions.
        log_prob: ``(B,)`` under the policy that sampled them.
        advantage: ``(B,)``.
        value_target: ``(B,)``.
    """

    observation: Tensor
    drawn: Tensor
    log_prob: Tensor
    advantage: Tensor
    value_target: Tensor


def clipped_losses(
    log_prob: Tensor, entropy: Tensor, values: Tensor, steps: PPOSteps, clip: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Clipped objective (Schulman et al. 2017, equation 7), squared error of the values, mean entropy.

    Args:
        log_prob: ``(B,)`` of the sampled actions under the current policy.
        entropy: ``(B,)`` of the current policy.
        values: ``(B,)`` of the current critic.
        steps: advantages are normalised over these ``B`` steps.
        clip: largest distance of the probability ratio from 1.
    """
    ratio = (log_prob - steps.log_prob).exp()
    advantage = _normalised(steps.advantage)
    gain = torch.min(ratio * advantage, ratio.clamp(1 - clip, 1 + clip) * advantage)
    return -gain.mean(), (values - steps.value_target).square().mean(), entropy.mean()


def clipped_derivatives(log_prob: Tensor, values: Tensor, steps: PPOSteps, clip: float) -> tuple[Tensor, Tensor]:
    """Derivatives ``(B,)`` of the first two ``clipped_losses``: by each log-probability, by each value."""
    ratio = (log_prob - steps.log_prob).exp()
    advantage = _normalised(steps.advantage)
    gain = ratio * advantage
    counts = gain <= ratio.clamp(1 - clip, 1 + clip) * advantage
    return gain.where(counts, 0.0) / -len(gain), (values - steps.value_target) * (2 / len(values))


def _normalised(advantage: Tensor) -> Tensor:
    return (advantage - advantage.mean()) / advantage.std().clamp_min(1e-6)


class PPO:
    """The learner and its policies.

    Args:
        config: see ``PPOConfig``.
        observation_size: O.
        actions: of the environment.
        total_frames: frames after which learning rate and entropy bonus reach 0.
        ignored: indices of the observation that are hidden from it.
        parts: of the leading numbers of an observation.
        mirror: the mirror image that its networks are equivariant under; None: none.

    Attributes:
        policy: explores; run by the collector.
        greedy: evaluated and explained.
    """

    kind, settings = "ppo", PPOConfig

    def __init__(
        self,
        config: PPOConfig,
        observation_size: int,
        actions: gymnasium.Space[Any],
        total_frames: int,
        ignored: Sequence[int] = (),
        parts: Sequence[Part] = (),
        mirror: MirroredSpaces | None = None,
    ):
        self._config, self._total_frames, self._frames = config, total_frames, 0
        self._standardiser = Standardiser(observation_size, parts, config.standardise_observations, mirror)
        self._rewards = RewardStandardiser(config.standardise_rewards, config.gamma)
        self._actions = make_actions(actions, config.first_std)
        reads: dict[str, Any] = {"ignored": ignored, "parts": parts, "standardiser": self._standardiser}
        network = make_network(
            observation_size, config.hidden, self._actions.outputs, nn.ReLU, 0.01, mirror=mirror, **reads
        )
        self._actor = self._actions.finish(network)
        of_value = mirror and mirror.of_value()
        self._critic = make_network(observation_size, config.hidden, 1, nn.ReLU, 1.0, mirror=of_value, **reads)
        self._acting = plain_copy(self._actor)
        self.policy = SamplingPolicy(plain_copy(self._actor), self._actions, config.noise_steps)
        self.greedy = GreedyPolicy(self._acting, config.average_share, self._actions.mode)
        value = ValueOperator(self._critic, in_keys=["observation"])
        self._estimate = GAE(gamma=config.gamma, lmbda=config.gae_lambda, value_network=value)
        self._passes = differentiated(self._actor), differentiated(self._critic)
        learnt = [*self._actor.parameters(), *self._critic.parameters()]
        self._optimizer = FlatAdam(learnt, config.learning_rate, eps=1e-5)

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from a batch ``[N, T]``; returns the last minibatch's losses.

        Where observations are standardised, the first batch only measures them; its losses are NaN.

        Raises:
            FloatingPointError: if a loss or the weights are NaN or infinite.
        """
        left = 1 - min(self._frames / self._total_frames, 1)  # share of the run
        self._optimizer.param_groups[0]["lr"] = left * self._config.learning_rate
        self._frames += batch.numel()
        if not self._standardiser.decided and self._standardiser.learn(batch["observation"]):
            self._follow()
            return dict.fromkeys(("policy_loss", "value_loss", "entropy"), math.nan)
        steps = self._prepare(batch)
        for _ in range(self._config.epochs):
            for rows in torch.randperm(batch.numel()).split(self._config.minibatch_size):
                drawn = PPOSteps(*(column[rows] for column in steps))
                evaluated = self._step(drawn, left * self._config.entropy)
        policy_loss, value_loss, entropy = map(float, clipped_losses(*evaluated, drawn, self._config.clip))
        losses = {"policy_loss": policy_loss, "value_loss": value_loss, "entropy": entropy}
        check_finite(losses, [self._optimizer.flat])
        self._standardiser.learn(batch["observation"])  # after learning, which needs the policy that acted
        self._follow()
        return losses

    def _follow(self) -> None:
        self._acting.load_state_dict(plain_weights(self._actor))
        self.greedy.follow(self._acting)

    def _prepare(self, batch: TensorDictBase) -> PPOSteps:
        """Estimate advantages over whole rows, then flatten rows and time."""
        ends = [("next", name) for name in ("observation", "done", "terminated")]
        data = batch.select("observation", *ends)
        reward = learning_reward(batch, self._config)
        self._rewards.learn(reward, batch["next", "done"])
        data["next", "reward"] = reward * self._rewards.factor
        with torch.no_grad():
            self._estimate(data)
        return PPOSteps(
            observation=data["observation"].flatten(0, 1),
            drawn=batch[self._actions.learnt_from].flatten(0, 1),
            log_prob=batch["action_log_prob"].flatten(),
            advantage=data["advantage"].flatten(),
            value_target=data["value_target"].flatten(),
        )

    @torch.no_grad()
    def _step(self, steps: PPOSteps, entropy_weight: float) -> tuple[Tensor, Tensor, Tensor]:
        """Take a gradient step; log-probabilities, entropies and values, each ``(B,)``, as they were before it."""
        act, judge = self._passes
        (outputs, actor_backward), (values, critic_backward) = act(steps.observation), judge(steps.observation)
        values = values.squeeze(-1)
        log_prob, entropies = self._actions.evaluate_actions(outputs, steps.drawn)
        by_log_prob, by_value = clipped_derivatives(log_prob, values, steps, self._config.clip)
        by_outputs = self._actions.gradient(outputs, steps.drawn, by_log_prob, -entropy_weight / len(values))
        gradients = actor_backward(by_outputs) + critic_backward(self._config.value_weight * by_value[:, None])
        self._optimizer.descend(gradients, self._config.max_grad_norm)
        return log_prob, entropies, values

    @property
    def standardised(self) -> list[str]:
        """See ``standardise.standardised``."""
        return standardised(self._standardiser, self._rewards)

    def sync_weights(self) -> None:
        """See ``Agent``."""
        self.policy.network.load_state_dict(plain_weights(self._actor))
        self.policy.batch += 1

    def state_dict(self) -> dict[str, Any]:
        """See ``Agent``."""
        return {
            "actor": self._actor.state_dict(),
            "critic": self._critic.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "greedy": self.greedy.state_dict(),
            "frames": self._frames,
            "rewards": self._rewards.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``."""
        for name in ("actor", "critic", "optimizer"):
            getattr(self, f"_{name}").load_state_dict(state[name])
        self.greedy.load_state_dict(state["greedy"])
        self._frames = state["frames"]
        self._rewards.load_state_dict(state.get("rewards"))
