"""Action distributions, parametrised by the outputs of a network.

Shapes: ``B`` steps, ``A`` numbers of a continuous action, ``K`` outputs of the network for one step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

import gymnasium
import numpy as np
import torch
from torch import Tensor, nn

from ibe_rl.task import choices_of
from ibe_rl.types import ConfigError

RAW_ACTION = "action_drawn"
"""Entry of a batch: the continuous sample before scaling and clipping to the environment's bounds."""
Mode = Callable[[Tensor], Tensor]


class Actions(Protocol):
    """The action distribution given by the outputs of a network.

    Attributes:
        outputs: number of outputs of the network.
        learnt_from: entry of the batch that ``evaluate_actions`` takes.
    """

    outputs: int
    learnt_from: str

    def finish(self, network: nn.Module) -> nn.Module:
        """Add further learnt parameters of the distribution: ``(B, outputs)`` becomes ``(B, K)``."""

    def noise(self, outputs: Tensor) -> Tensor:
        """Noise ``(B, M)`` that decides the samples from outputs ``(B, K)``, whatever these are."""

    def draw(self, outputs: Tensor, noise: Tensor | None = None) -> dict[str, Tensor]:
        """Sample from outputs ``(B, K)``: entries ``action``, ``action_log_prob`` ``(B,)``, ``learnt_from``.

        Args:
            outputs: of the network.
            noise: from ``noise``; None: new noise.
        """

    def evaluate_actions(self, outputs: Tensor, drawn: Tensor) -> tuple[Tensor, Tensor]:
        """Outputs ``(B, K)`` and samples to log-probability ``(B,)`` and entropy ``(B,)``."""

    def gradient(self, outputs: Tensor, drawn: Tensor, by_log_prob: Tensor, by_entropy: float) -> Tensor:
        """Gradient ``(B, K)`` of a loss by the outputs.

        Args:
            outputs: ``(B, K)``.
            drawn: samples.
            by_log_prob: derivative ``(B,)`` of the loss by each log-probability.
            by_entropy: its derivative by each entropy.
        """

    def mode(self, outputs: Tensor) -> Tensor:
        """Outputs ``(B, K)`` to the most probable actions, in the environment's units."""


class Categorical:
    """One of ``n`` actions, counted from ``start``; the outputs are their logits."""

    learnt_from = "action"

    def __init__(self, n: int, start: int = 0):
        self.outputs, self._start = n, start

    def finish(self, network: nn.Module) -> nn.Module:
        """Nothing to add."""
        return network

    def noise(self, outputs: Tensor) -> Tensor:
        """See ``Actions``; from the Gumbel distribution, so that the highest sum is a sample (Gumbel 1954)."""
        return -torch.empty_like(outputs).exponential_().log()

    def draw(self, outputs: Tensor, noise: Tensor | None = None) -> dict[str, Tensor]:
        """See ``Actions``; ``action`` ``(B,)`` int64."""
        log_probs = outputs.log_softmax(-1)
        action = torch.multinomial(log_probs.exp(), 1) if noise is None else best(outputs + noise)[:, None]
        log_prob = log_probs.gather(-1, action).squeeze(-1)
        return {"action": action.squeeze(-1) + self._start, "action_log_prob": log_prob}

    def evaluate_actions(self, outputs: Tensor, drawn: Tensor) -> tuple[Tensor, Tensor]:
        """See ``Actions``."""
        log_probs = outputs.log_softmax(-1)
        chosen = log_probs.gather(-1, drawn[:, None] - self._start).squeeze(-1)
        return chosen, -(log_probs.exp() * log_probs).sum(-1)

    def gradient(self, outputs: Tensor, drawn: Tensor, by_log_prob: Tensor, by_entropy: float) -> Tensor:
        """See ``Actions``."""
        log_probs, by_chosen = outputs.log_softmax(-1), by_log_prob[:, None]
        probs = log_probs.exp()
        above_mean = log_probs - (probs * log_probs).sum(-1, keepdim=True)
        found = -probs * (by_chosen + by_entropy * above_mean)
        return found.scatter_add_(-1, drawn[:, None] - self._start, by_chosen)

    def mode(self, outputs: Tensor) -> Tensor:
        """See ``Actions``; ``(B,)`` int64."""
        return best(outputs) + self._start


class Categoricals:
    """Several choices at once, independent given the observation; the outputs are the logits of each in turn."""

    learnt_from = "action"

    def __init__(self, choices: Sequence[Categorical]):
        self._choices, self._sizes = choices, [one.outputs for one in choices]
        self.outputs = sum(self._sizes)

    def finish(self, network: nn.Module) -> nn.Module:
        """Nothing to add."""
        return network

    def _each(self, outputs: Tensor) -> Iterator[tuple[Categorical, Tensor]]:
        return zip(self._choices, outputs.split(self._sizes, dim=-1), strict=True)

    def noise(self, outputs: Tensor) -> Tensor:
        """See ``Actions``."""
        return torch.cat([one.noise(logits) for one, logits in self._each(outputs)], dim=-1)

    def draw(self, outputs: Tensor, noise: Tensor | None = None) -> dict[str, Tensor]:
        """See ``Actions``; ``action`` ``(B, A)`` int64."""
        noises = [None] * len(self._sizes) if noise is None else noise.split(self._sizes, dim=-1)
        drawn = [one.draw(logits, part) for (one, logits), part in zip(self._each(outputs), noises, strict=True)]
        log_prob = torch.stack([one["action_log_prob"] for one in drawn]).sum(0)
        return {"action": torch.stack([one["action"] for one in drawn], dim=-1), "action_log_prob": log_prob}

    def evaluate_actions(self, outputs: Tensor, drawn: Tensor) -> tuple[Tensor, Tensor]:
        """See ``Actions``."""
        parts = zip(self._each(outputs), drawn.unbind(-1), strict=True)
        found = [one.evaluate_actions(logits, column) for (one, logits), column in parts]
        return torch.stack([log_prob for log_prob, _ in found]).sum(0), torch.stack([e for _, e in found]).sum(0)

    def gradient(self, outputs: Tensor, drawn: Tensor, by_log_prob: Tensor, by_entropy: float) -> Tensor:
        """See ``Actions``."""
        parts = zip(self._each(outputs), drawn.unbind(-1), strict=True)
        return torch.cat([one.gradient(logits, c, by_log_prob, by_entropy) for (one, logits), c in parts], dim=-1)

    def mode(self, outputs: Tensor) -> Tensor:
        """See ``Actions``; ``(B, A)`` int64."""
        return torch.stack([one.mode(logits) for one, logits in self._each(outputs)], dim=-1)


def best(outputs: Tensor) -> Tensor:
    """Index of the highest output: ``(B, K)`` to ``(B,)`` int64."""
    return outputs.argmax(-1)


class GaussianNetwork(nn.Module):
    """A network of means, with learnt log standard deviations that do not depend on the state."""

    def __init__(self, network: nn.Module, size: int, first_std: float):
        super().__init__()
        self.network = network
        self.log_std = nn.Parameter(torch.full((size,), math.log(first_std)))

    def forward(self, observation: Tensor) -> Tensor:
        """Observations ``(B, O)`` to means and log standard deviations ``(B, 2 A)``."""
        means = self.network(observation)
        return torch.cat([means, self.log_std.expand_as(means)], dim=-1)


class Gaussian:
    """Bounded actions from a diagonal Gaussian.

    Means and deviations are in units of half the range around its middle. The environment gets samples clipped to the
    bounds; learning uses the unclipped ones.

    Args:
        low: ``(A,)`` bounds in the environment's units.
        high: ``(A,)``.
        first_std: initial standard deviation, in units of half the range.
    """

    learnt_from = RAW_ACTION

    def __init__(self, low: Tensor, high: Tensor, first_std: float):
        self.outputs, self._low, self._high, self._first_std = len(low), low, high, first_std
        self._middle, self._half = (low + high) / 2, (high - low) / 2

    def finish(self, network: nn.Module) -> nn.Module:
        """Add the standard deviations."""
        return GaussianNetwork(network, self.outputs, self._first_std)

    def noise(self, outputs: Tensor) -> Tensor:
        """See ``Actions``; in standard deviations."""
        return torch.randn_like(outputs.chunk(2, dim=-1)[0])

    def draw(self, outputs: Tensor, noise: Tensor | None = None) -> dict[str, Tensor]:
        """See ``Actions``; ``action`` ``(B, A)`` float32."""
        mean, log_std = outputs.chunk(2, dim=-1)
        drawn = mean + log_std.exp() * (self.noise(outputs) if noise is None else noise)
        log_prob, _ = self.evaluate_actions(outputs, drawn)
        return {"action": self._bounded(drawn), "action_log_prob": log_prob, RAW_ACTION: drawn}

    def evaluate_actions(self, outputs: Tensor, drawn: Tensor) -> tuple[Tensor, Tensor]:
        """See ``Actions``; densities are of the unscaled sample."""
        mean, log_std = outputs.chunk(2, dim=-1)
        distance = (drawn - mean) * (-log_std).exp()
        log_prob = (-0.5 * distance.square() - log_std - 0.5 * math.log(2 * math.pi)).sum(-1)
        return log_prob, (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum(-1)

    def gradient(self, outputs: Tensor, drawn: Tensor, by_log_prob: Tensor, by_entropy: float) -> Tensor:
        """See ``Actions``."""
        mean, log_std = outputs.chunk(2, dim=-1)
        precision, by_each = (-log_std).exp(), by_log_prob[:, None]
        distance = (drawn - mean) * precision
        return torch.cat([by_each * distance * precision, by_each * (distance.square() - 1) + by_entropy], dim=-1)

    def mode(self, outputs: Tensor) -> Tensor:
        """See ``Actions``; ``(B, A)`` float32."""
        return self._bounded(outputs.chunk(2, dim=-1)[0])

    def _bounded(self, drawn: Tensor) -> Tensor:
        return (self._middle + self._half * drawn).clamp(self._low, self._high)


def discrete(space: gymnasium.Space[Any]) -> bool:
    """True for ``Discrete``."""
    return isinstance(space, gymnasium.spaces.Discrete)


def continuous(space: gymnasium.Space[Any]) -> bool:
    """True for a one-dimensional floating-point ``Box`` with finite bounds."""
    if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1 or not space.shape[0]:
        return False
    return bool(np.issubdtype(space.low.dtype, np.floating) and np.isfinite([space.low, space.high]).all())


def make_actions(space: gymnasium.Space[Any], first_std: float) -> Actions:
    """Make the distribution for an action space.

    Raises:
        ConfigError: for any other space.
    """
    if isinstance(space, gymnasium.spaces.Discrete) and discrete(space):
        return Categorical(int(space.n), int(space.start))
    if choices := choices_of(space):
        return Categoricals([Categorical(n, start) for n, start in choices])
    if isinstance(space, gymnasium.spaces.Box) and continuous(space):
        low, high = (torch.from_numpy(bound.astype(np.float32)) for bound in (space.low, space.high))
        return Gaussian(low, high, first_std)
    raise ConfigError(
        f"env: its actions are {space}; allowed are Discrete, or with agent=ppo one row of MultiDiscrete, MultiBinary "
        "or floating-point numbers with finite bounds (Box)"
    )
