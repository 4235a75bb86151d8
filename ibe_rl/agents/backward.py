"""Forward passes that know the way back: the gradients of an MLP, written out.

With networks this small, autograd's bookkeeping costs a third of a gradient step (docs/LOG.md). Networks that read
images keep it. A test checks that both give the same gradients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import takewhile
from typing import cast

import torch
from torch import Tensor, nn

from ibe_rl.agents.actions import GaussianNetwork
from ibe_rl.agents.equivariant import MirroredLinear, PairedLinear
from ibe_rl.agents.networks import InputMask
from ibe_rl.agents.standardise import Standardiser

Backward = Callable[[Tensor], list[Tensor]]
"""Gradient ``(B, K)`` of a loss by a network's outputs to that by each of its parameters, in their order."""
Forward = Callable[[Tensor], tuple[Tensor, Backward]]
"""Observations ``(B, O)`` to outputs ``(B, K)`` and the backward pass."""


def differentiated(network: nn.Module) -> Forward:
    """The forward pass of a network that is to be learnt.

    Written out for linear layers with ReLU between them, mirrored or not, after a standardiser and a mask of the
    inputs; with the standard deviations of continuous actions or not. Any other network is left to autograd.
    """
    if isinstance(network, GaussianNetwork):
        return partial(_gaussian, differentiated(network.network), network.log_std)
    steps = _steps(network)
    before = list(takewhile(lambda step: isinstance(step, Standardiser | InputMask), steps))
    layers = steps[len(before) :]
    linear, between = layers[::2], layers[1::2]
    if all(isinstance(one, nn.Linear) for one in linear) and all(isinstance(one, nn.ReLU) for one in between):
        return partial(_mlp, nn.Sequential(*before), cast("list[nn.Linear]", linear))
    return partial(_by_autograd, network, list(network.parameters()))


def _steps(module: nn.Module) -> list[nn.Module]:
    """What is computed one after the other."""
    return [step for child in module for step in _steps(child)] if isinstance(module, nn.Sequential) else [module]


def _gaussian(forward: Forward, log_std: Tensor, observation: Tensor) -> tuple[Tensor, Backward]:
    means, backward = forward(observation)

    def both(by_outputs: Tensor) -> list[Tensor]:
        by_means, by_log_std = by_outputs.chunk(2, dim=-1)
        return [by_log_std.sum(0), *backward(by_means)]

    return torch.cat([means, log_std.detach().expand_as(means)], dim=-1), both


def _by_autograd(
    network: nn.Module, parameters: Sequence[nn.Parameter], observation: Tensor
) -> tuple[Tensor, Backward]:
    with torch.enable_grad():
        outputs = network(observation)
    return outputs.detach(), lambda by_outputs: list(torch.autograd.grad(outputs, parameters, by_outputs))


@torch.no_grad()
def _mlp(before: nn.Module, layers: Sequence[nn.Linear], observation: Tensor) -> tuple[Tensor, Backward]:
    outputs, inputs, weights = before(observation), list[Tensor](), list[Tensor]()
    for layer in layers:
        if inputs:
            outputs = outputs.relu_()
        weight, bias = layer.whole() if isinstance(layer, PairedLinear | MirroredLinear) else (layer.weight, layer.bias)
        inputs.append(outputs)
        weights.append(weight)
        outputs = torch.addmm(bias, outputs, weight.t())
    return outputs, partial(_mlp_backward, layers, inputs, weights)


@torch.no_grad()
def _mlp_backward(
    layers: Sequence[nn.Linear], inputs: Sequence[Tensor], weights: Sequence[Tensor], by_outputs: Tensor
) -> list[Tensor]:
    gradients: list[Tensor] = []
    for number in reversed(range(len(layers))):
        layer, given = layers[number], inputs[number]
        found = by_outputs.t() @ given, by_outputs.sum(0)
        if isinstance(layer, PairedLinear | MirroredLinear):
            found = layer.own_gradients(*found)
        gradients[:0] = found
        if number:  # ReLU passes on what it let through
            by_outputs = torch.ops.aten.threshold_backward(by_outputs @ weights[number], given, 0)
    return gradients
