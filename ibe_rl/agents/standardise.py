"""Standardisation of what agents learn from: observations by running mean and deviation, rewards by that of returns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from ibe_rl.agents.equivariant import MirroredSpaces
from ibe_rl.task import FLAGS, IMAGE, Part

LARGEST, SMALLEST = 30.0, 0.01
"""Numbers whose size or deviation is outside of these need standardising."""
MOST, LEAST = 100.0, 0.01
"""Returns whose deviation is outside of these need standardising."""
LIMIT = 10.0
"""Standardised numbers are clipped to plus and minus this."""
BYTE = 255.0
NUMBERS_AT_ONCE = 4_000_000
"""Most numbers of a batch that are measured."""


class Standardiser(nn.Module):
    """The first step of a network: standardises numbers one by one and images by channel.

    Flags, and what follows the parts (the instruction), stay as they are. While it is off, numbers do too, and images
    are scaled to [0, 1].

    Args:
        inputs: ``O``.
        parts: of the leading inputs.
        wanted: None: the first batch decides (see ``LARGEST``).
        mirror: observations are measured with their mirror images; None: alone.

    Attributes:
        on: whether it standardises.
    """

    decided: Tensor
    on: Tensor
    count: Tensor
    mean: Tensor
    var: Tensor
    shift: Tensor
    scale: Tensor

    def __init__(self, inputs: int, parts: Sequence[Part], wanted: bool | None, mirror: MirroredSpaces | None = None):
        super().__init__()
        self._mirror = mirror
        self._wanted, self._images = wanted, any(part.kind == IMAGE for part in parts)
        self._groups, self._units = _groups(parts)
        buffers = {
            "decided": torch.tensor(wanted is False),
            "on": torch.tensor(False),
            "count": torch.zeros((), dtype=torch.float64),
            "mean": torch.zeros(inputs, dtype=torch.float64),
            "var": torch.zeros(inputs, dtype=torch.float64),
            "shift": torch.zeros(inputs),
            "scale": torch.ones(inputs),
        }
        for name, value in buffers.items():
            self.register_buffer(name, value)
        bytes_ = [part.kind == IMAGE for part in parts for _ in range(part.size)]
        self.scale[: len(bytes_)][torch.tensor(bytes_, dtype=torch.bool)] = 1 / BYTE
        self.register_load_state_dict_pre_hook(_complete)

    def forward(self, observation: Tensor) -> Tensor:
        """Observations ``(..., O)`` to observations."""
        if not self.on:
            return observation * self.scale if self._images else observation
        return ((observation - self.shift) * self.scale).clamp(-LIMIT, LIMIT)

    @torch.no_grad()
    def learn(self, observations: Tensor) -> bool:
        """Measure observations ``(..., O)``; True if they were the first and are standardised from now on."""
        first = not self.decided
        if not len(self._units) or not (first or self.on):
            return False
        if self._mirror:
            observations = self._mirror.with_images(observations)
        rows = observations.flatten(0, -2)[:, : len(self._groups)]
        rows = rows[:: max(1, rows.numel() // NUMBERS_AT_ONCE)].double()
        mean, var = self._measured(rows)
        if first:
            self.decided.fill_(True)
            self.on.fill_(bool(self._wanted) or self._far(rows, mean, var))
            if not self.on:
                return False
        self._merge(len(rows), mean, var)
        return first

    def _measured(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and variance ``(G,)`` of each group of columns."""
        seen = self._groups >= 0
        var, mean = torch.var_mean(rows[:, seen], dim=0, correction=0)
        groups = self._groups[seen]
        size = torch.bincount(groups, minlength=len(self._units))
        middle = torch.bincount(groups, mean, minlength=len(self._units)) / size
        spread = torch.bincount(groups, var + (mean - middle[groups]).square(), minlength=len(self._units)) / size
        return middle, spread

    def _far(self, rows: Tensor, mean: Tensor, var: Tensor) -> bool:
        """Whether a number is large, or varies little without being 0 or 1 only."""
        whole = ((rows == rows.round()) & (rows.abs() <= 1)).all(0)
        counted = torch.zeros_like(mean, dtype=torch.bool)
        counted[self._groups[(self._groups >= 0) & ~whole]] = True
        size, std = (mean.square() + var).sqrt() / self._units, var.sqrt() / self._units
        return bool((counted & (var > 0) & ((size > LARGEST) | (std < SMALLEST))).any())

    def _merge(self, count: int, mean: Tensor, var: Tensor) -> None:
        """Add the mean and variance of ``count`` rows (Chan et al. 1979)."""
        total = self.count + count
        known, spread = self.mean[: len(mean)], self.var[: len(mean)]
        apart, share = mean - known, count / total
        spread.copy_((1 - share) * spread + share * var + share * (1 - share) * apart.square())
        known.add_(share * apart)
        self.count.copy_(total)
        std = spread.sqrt()
        scale = torch.where(std > 1e-6 * (1 + known.abs()), 1 / std.clamp_min(1e-12), 1.0)
        columns = self._groups >= 0
        end = len(columns)
        self.shift[:end][columns] = self.mean[self._groups[columns]].float()
        self.scale[:end][columns] = scale[self._groups[columns]].float()


def _complete(module: nn.Module, state: dict[str, Any], prefix: str, *_: Any) -> None:
    """Older checkpoints have no standardiser: it stays off."""
    if f"{prefix}count" not in state:
        state |= {f"{prefix}{name}": value for name, value in module.state_dict().items()}
        state[f"{prefix}decided"], state[f"{prefix}on"] = torch.tensor(True), torch.tensor(False)


def _groups(parts: Iterable[Part]) -> tuple[Tensor, Tensor]:
    """For each leading input the number of its mean and deviation, -1: it has none; and the units ``(G,)`` of these."""
    found: list[Tensor] = [torch.zeros(0, dtype=torch.long)]
    units: list[float] = []
    for part in parts:
        if part.kind == FLAGS:
            found.append(torch.full((part.size,), -1))
        elif part.kind == IMAGE:
            pixels, channels = part.size // part.shape[2], len(units) + torch.arange(part.shape[2])
            found.append(channels.repeat_interleave(pixels) if part.channels_first else channels.repeat(pixels))
            units += [BYTE] * part.shape[2]
        else:
            found.append(len(units) + torch.arange(part.size))
            units += [1.0] * part.size
    return torch.cat(found), torch.tensor(units, dtype=torch.float64)


class RewardStandardiser:
    """Divides rewards by the running deviation of the discounted returns.

    Args:
        wanted: None: the first batch whose returns differ decides (see ``MOST``).
        gamma: discount factor.
    """

    def __init__(self, wanted: bool | None, gamma: float):
        self._wanted, self._gamma = wanted, gamma
        self._decided, self.on = wanted is False, False
        self._count = self._mean = self._var = 0.0
        self._returns: Tensor | None = None

    @property
    def factor(self) -> float:
        """What rewards are multiplied by."""
        return self._var**-0.5 if self.on and self._var > 0 else 1.0

    def learn(self, reward: Tensor, done: Tensor) -> None:
        """Measure rewards ``[N, T, 1]``; row i of every batch continues the same environment."""
        if self._decided and not self.on:
            return
        returns = self._discounted(reward.squeeze(-1).double(), done.squeeze(-1))
        var, mean = (float(one) for one in torch.var_mean(returns, correction=0))
        total = self._count + returns.numel()
        apart, share = mean - self._mean, returns.numel() / total
        self._var = (1 - share) * self._var + share * var + share * (1 - share) * apart**2
        self._mean, self._count = self._mean + share * apart, total
        if not self._decided and self._var > 0:
            self._decided, self.on = True, bool(self._wanted) or not LEAST <= self._var**0.5 <= MOST

    def _discounted(self, reward: Tensor, done: Tensor) -> Tensor:
        """Discounted sums ``(N, T)`` of the rewards of the episode so far."""
        sums, now = torch.empty_like(reward), self._returns
        now = torch.zeros(len(reward), dtype=torch.float64) if now is None else now
        for step in range(reward.shape[1]):
            now = now * self._gamma + reward[:, step]
            sums[:, step] = now
            now = now * ~done[:, step]
        self._returns = now
        return sums

    def state_dict(self) -> dict[str, Any]:
        """All that it continues from."""
        return {name.lstrip("_"): value for name, value in vars(self).items() if name not in ("_wanted", "_gamma")}

    def load_state_dict(self, state: dict[str, Any] | None) -> None:
        """The inverse of ``state_dict``; None: of a checkpoint from before there was one, which stays off."""
        self._decided, self.on = (True, False) if state is None else (state["decided"], state["on"])
        if state is not None:
            self._count, self._mean, self._var = state["count"], state["mean"], state["var"]
            self._returns = state["returns"]


def standardised(observations: Standardiser, rewards: RewardStandardiser) -> list[str]:
    """What is standardised, as summary.json names it: "observations", "rewards"."""
    return [name for name, on in (("observations", bool(observations.on)), ("rewards", rewards.on)) if on]
