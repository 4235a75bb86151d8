"""The members of an ensemble: small networks from state and action to the change in one step.

Shapes: ``M`` members, ``S`` state dimensions, ``A`` columns of an action, ``n`` rows of each member.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ibe_rl.predict.experience import Steps
from ibe_rl.types import Array

Layers = list[tuple[Tensor, Tensor]]
"""Weights ``(M, inputs, outputs)`` and biases ``(M, 1, outputs)`` of each layer."""
WARM_UP_UPDATES = 20
MAX_GRADIENT_NORM = 10.0


@dataclass(frozen=True)
class Scale:
    """Normalisation of states, and the type of each dimension.

    Attributes:
        mean: ``(S,)`` of the states.
        spread: ``(S,)`` standard deviation of the states.
        step: ``(S,)`` standard deviation of the change in one step; 0: the dimension is constant.
        binary: ``(S,)`` bool, the dimension is 0 or 1 and not constant.
    """

    mean: Array
    spread: Array
    step: Array
    binary: Array

    @classmethod
    def of(cls, steps: Steps) -> Scale:
        """Estimate from steps."""
        states, change = steps.states, steps.after - steps.states
        varies = np.any(change != 0, axis=0)
        spread, step = states.std(axis=0), np.where(varies, change.std(axis=0), 0)
        flags = np.all((steps.after == 0) | (steps.after == 1), axis=0)
        return cls(states.mean(axis=0), np.where(spread > 0, spread, 1), step.astype(np.float32), flags & varies)

    @property
    def graded(self) -> Array:
        """``(S,)`` bool, the dimensions that vary and are not 0 or 1."""
        return (self.step > 0) & ~self.binary

    def to_dict(self) -> dict[str, Array]:
        """Arrays by name."""
        return {item.name: getattr(self, item.name) for item in fields(self)}


def make_layers(members: int, sizes: Sequence[int], seed: int) -> Layers:
    """Initial weights; those of the last layer are small, which predicts almost no change."""
    generator = torch.Generator().manual_seed(seed)
    layers = []
    for number, (inputs, outputs) in enumerate(pairwise(sizes)):
        gain = (2 / inputs) ** 0.5 * (0.1 if number == len(sizes) - 2 else 1)
        layers.append(
            (torch.randn(members, inputs, outputs, generator=generator) * gain, torch.zeros(members, 1, outputs))
        )
    return layers


def run(layers: Layers, inputs: Tensor) -> Tensor:
    """Inputs ``(M, n, inputs)`` to outputs ``(M, n, outputs)``."""
    for weights, bias in layers[:-1]:
        inputs = torch.baddbmm(bias, inputs, weights).relu_()
    return torch.baddbmm(layers[-1][1], inputs, layers[-1][0])


def in_state_units(layers: Layers, scale: Scale) -> Layers:
    """Fold the normalisation into the first and last layer.

    Outputs are the ``S`` changes of one step (for binary dimensions the logit of 1) and the logit of termination.
    """
    size = len(scale.mean)
    (first, first_bias), (last, last_bias) = layers[0], layers[-1]
    per_state = torch.from_numpy(1 / scale.spread)[:, None]
    first = torch.cat([first[:, :size] * per_state, first[:, size:]], dim=1)
    first_bias = first_bias - torch.from_numpy(scale.mean) @ first[:, None, :size]
    units = torch.from_numpy(np.append(np.where(scale.binary, 1, scale.step), 1).astype(np.float32))
    if len(layers) == 1:
        return [(first * units, first_bias * units)]
    return [(first, first_bias), *layers[1:-1], (last * units, last_bias * units)]


def train_members(
    layers: Layers, scale: Scale, steps: Steps, updates: int, minibatch_size: int, learning_rate: float, seed: int
) -> Layers:
    """Continue training, each member on its own bootstrap sample of the episodes.

    Args:
        layers: initial weights; not changed.
        scale: of the states.
        steps: training data.
        updates: of all members.
        minibatch_size: steps per member and update.
        learning_rate: falls linearly to 0.
        seed: of all draws.
    """
    generator = torch.Generator().manual_seed(seed)
    layers = [(weights.clone().requires_grad_(), bias.clone().requires_grad_()) for weights, bias in layers]
    parameters = [each for layer in layers for each in layer]
    optimizer = torch.optim.Adam(parameters, learning_rate, fused=True)
    drawn = _bootstrap(steps, len(layers[0][0]), generator)
    columns = [torch.from_numpy(each) for each in _inputs_and_targets(scale, steps)]
    losses = _Losses(scale)
    for update in range(updates):
        optimizer.param_groups[0]["lr"] = (
            learning_rate * min(1, (update + 1) / WARM_UP_UPDATES) * (1 - update / updates)
        )
        rows = torch.stack([each[torch.randint(len(each), (minibatch_size,), generator=generator)] for each in drawn])
        inputs, targets = (column[rows] for column in columns)
        optimizer.zero_grad()
        losses(run(layers, inputs), targets).backward()
        torch.nn.utils.clip_grad_norm_(parameters, MAX_GRADIENT_NORM)
        optimizer.step()
    return [(weights.detach(), bias.detach()) for weights, bias in layers]


def _bootstrap(steps: Steps, members: int, generator: torch.Generator) -> list[Tensor]:
    """Rows of a bootstrap sample of the episodes for each member."""
    lengths = torch.from_numpy(np.bincount(steps.episode))
    ends = lengths.cumsum(0)
    found = []
    for _ in range(members):
        chosen = torch.randint(len(lengths), (len(lengths),), generator=generator)
        counts = lengths[chosen]
        before = torch.repeat_interleave(counts.cumsum(0) - counts, counts)
        starts = torch.repeat_interleave(ends[chosen] - counts, counts)
        found.append(starts + torch.arange(int(counts.sum())) - before)
    return found


def _inputs_and_targets(scale: Scale, steps: Steps) -> tuple[Array, Array]:
    """Inputs ``(T, S + A)``; targets ``(T, S + 1)``: changes over ``scale.step`` or binary values, and the end."""
    unit = np.where(scale.step > 0, scale.step, 1)
    change = np.where(scale.binary, steps.after, (steps.after - steps.states) / unit)
    inputs = np.concatenate([(steps.states - scale.mean) / scale.spread, steps.actions], axis=1)
    return inputs.astype(np.float32), np.concatenate([change, steps.ended[:, None]], axis=1).astype(np.float32)


class _Losses:
    """Loss summed over outputs, averaged over everything else."""

    def __init__(self, scale: Scale):
        self._graded = torch.from_numpy(np.flatnonzero(scale.graded))
        self._logits = torch.from_numpy(np.append(np.flatnonzero(scale.binary), len(scale.mean)))

    def __call__(self, outputs: Tensor, targets: Tensor) -> Tensor:
        # smooth L1: the largest changes are impacts that no state predicts
        graded = functional.smooth_l1_loss(outputs[..., self._graded], targets[..., self._graded], reduction="sum")
        logits = functional.binary_cross_entropy_with_logits(
            outputs[..., self._logits], targets[..., self._logits], reduction="sum"
        )
        return (graded + logits) / outputs[..., 0].numel()


def layers_to_dict(layers: Layers) -> dict[str, Any]:
    """Arrays by name."""
    named = {f"weights_{i}": weights for i, (weights, _) in enumerate(layers)}
    named |= {f"bias_{i}": bias for i, (_, bias) in enumerate(layers)}
    return {name: tensor.numpy().copy() for name, tensor in named.items()}


def layers_from_dict(values: dict[str, Any], like: Layers) -> Layers:
    """The inverse of ``layers_to_dict``, for members made with the same settings.

    Raises:
        ValueError: if shapes differ.
    """
    found = []
    for i, layer in enumerate(like):
        arrays = [torch.from_numpy(np.array(values[name], np.float32)) for name in (f"weights_{i}", f"bias_{i}")]
        if any(one.shape != other.shape for one, other in zip(arrays, layer, strict=True)):
            shapes = [tuple(one.shape) for one in arrays], [tuple(one.shape) for one in layer]
            raise ValueError(f"layer {i} has the shapes {shapes[0]}, expected {shapes[1]}")
        found.append((arrays[0], arrays[1]))
    return found
