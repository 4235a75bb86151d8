"""The agents' networks, and the averaged weights that are evaluated and explained."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel
from torchrl.modules import MLP

from ibe_rl.agents.actions import Mode, best
from ibe_rl.agents.encoder import Encoder, encoded_size, has_images
from ibe_rl.agents.equivariant import MirroredSpaces, make_equivariant
from ibe_rl.task import Part
from ibe_rl.types import Array


class InputMask(nn.Module):
    """Zeroes the inputs with the indices ``ignored``."""

    seen: Tensor

    def __init__(self, inputs: int, ignored: Sequence[int]):
        super().__init__()
        seen = torch.ones(inputs, dtype=torch.bool)
        seen[list(ignored)] = False
        self.register_buffer("seen", seen)

    def forward(self, observation: Tensor) -> Tensor:
        """Observations ``(..., O)`` to observations."""
        return observation.where(self.seen, 0.0)


def make_network(
    inputs: int,
    hidden: Sequence[int],
    outputs: int,
    activation: type[nn.Module],
    last_gain: float,
    ignored: Sequence[int] = (),
    parts: Sequence[Part] = (),
    standardiser: nn.Module | None = None,
    mirror: MirroredSpaces | None = None,
) -> nn.Sequential:
    """An MLP with orthogonal weights.

    Args:
        inputs: ``O``.
        hidden: layer widths.
        outputs: number of outputs.
        activation: between layers.
        last_gain: factor of the weights of the last layer.
        ignored: inputs that are masked.
        parts: of the leading inputs; images are encoded first.
        standardiser: the first step; None: none.
        mirror: what it is made equivariant under; None: nothing.
    """
    first: dict[str, nn.Module] = {} if standardiser is None else {"standardise": standardiser}
    if has_images(parts):
        first["encode"], inputs = Encoder(inputs, parts), encoded_size(inputs, parts)
    network = MLP(in_features=inputs, out_features=outputs, num_cells=list(hidden), activation_class=activation)
    layers = [layer for layer in network if isinstance(layer, nn.Linear)]
    for layer in layers:
        nn.init.orthogonal_(layer.weight, last_gain if layer is layers[-1] else 2**0.5)
        nn.init.zeros_(layer.bias)
    if mirror:
        make_equivariant(network, *mirror)
    steps = {"0": InputMask(inputs, ignored), "1": network} if ignored else dict(network.named_children())
    return nn.Sequential(OrderedDict(first | steps))


class GreedyPolicy:
    """The greedy action of a network with averaged weights.

    The average varies less between updates than the weights. It spans a share of all updates so far: early it
    follows fast, late it is steady (Shamir and Zhang 2013, polynomial-decay averaging).

    Args:
        network: observations ``(N, O)`` to outputs ``(N, K)``; not changed.
        share: approximate share of the updates so far that the average spans; 0: the current weights.
        mode: outputs to actions; default: the argmax.
    """

    def __init__(self, network: nn.Module, share: float, mode: Mode = best):
        self._mode = mode
        self._average = AveragedModel(network, avg_fn=partial(_move, share))

    def follow(self, network: nn.Module) -> None:
        """Update the average with the network's current weights."""
        self._average.update_parameters(network)

    @torch.no_grad()
    def __call__(self, observations: Array) -> Array:
        """Observations ``(N, O)`` float32 to actions, ``(N,)`` int64 or ``(N, A)`` float32."""
        actions: Array = self._mode(self._average.module(torch.from_numpy(observations))).numpy()
        return actions

    def state_dict(self) -> dict[str, Tensor]:
        """The averaged weights and their number of updates."""
        return dict(self._average.state_dict())

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """The inverse of ``state_dict``."""
        self._average.load_state_dict(state)


def check_finite(losses: Mapping[str, float], parameters: Iterable[Tensor]) -> None:
    """Check the result of an update for NaN and infinity.

    Raises:
        FloatingPointError: naming the loss, or the weights.
    """
    for name, loss in losses.items():
        if not math.isfinite(loss):
            raise FloatingPointError(f"{name}={loss:g}")
    if not all(bool(weights.isfinite().all()) for weights in parameters):
        raise FloatingPointError("weights are not finite numbers")


def _move(share: float, average: Tensor, current: Tensor, updates: Tensor | int) -> Tensor:
    return torch.lerp(average, current, 1 / (1 + share * float(updates)))


def linear(start: float, end: float, progress: float) -> float:
    """Interpolate linearly from ``start`` (progress 0) to ``end`` (progress 1 and later)."""
    return start + (end - start) * min(max(progress, 0.0), 1.0)
