"""Networks that are equivariant under a mirror image: of the mirrored input they give the mirrored output.

Half of the units of each layer are the other half's mirror images, with the same weights. What is learnt on one side is
known on the other, exactly and from the first step (van der Pol et al. 2020, MDP homomorphic networks).
"""

from __future__ import annotations

from copy import deepcopy
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import linear
from torch.nn.utils import skip_init

from ibe_rl.task.mirror import SignedPermutation


class MirroredSpaces(NamedTuple):
    """What a mirror image does to the inputs and the outputs of a network."""

    observations: SignedPermutation
    outputs: SignedPermutation

    def of_value(self) -> MirroredSpaces:
        """For a network whose only output, a value, is the same in the mirror image."""
        return MirroredSpaces(self.observations, SignedPermutation.of_signs((1.0,)))

    def with_images(self, observations: Tensor) -> Tensor:
        """Observations ``(..., O)`` and their mirror images, ``(2, ..., O)``."""
        images = observations[..., list(self.observations.order)] * torch.tensor(self.observations.signs)
        return torch.stack([observations, images])


class PairedLinear(nn.Linear):
    """A hidden layer in two halves: of the mirrored input they change places.

    Args:
        layer: its first half of rows is kept.
        inputs: what the mirror image does to the inputs.
    """

    image: Tensor

    def __init__(self, layer: nn.Linear, inputs: SignedPermutation):
        half = layer.out_features // 2
        super().__init__(layer.in_features, half)
        _keep(self, layer.weight[:half], layer.bias[:half], inputs)

    def whole(self) -> tuple[Tensor, Tensor]:
        """Weights ``(2 * H, I)`` and biases ``(2 * H,)`` of both halves."""
        weight = torch.cat([self.weight, self.weight @ self.image])
        return weight, torch.cat([self.bias, self.bias])

    def own_gradients(self, weight: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients by the whole weights and biases to those by its own."""
        half = self.out_features
        return torch.addmm(weight[:half], weight[half:], self.image), bias[:half] + bias[half:]

    def forward(self, observation: Tensor) -> Tensor:
        """``(..., I)`` to ``(..., 2 * H)``."""
        return linear(observation, *self.whole())


class MirroredLinear(nn.Linear):
    """A last layer: of the mirrored input it gives the mirrored output.

    Args:
        layer: the layer that is made symmetric.
        inputs: what the mirror image does to the inputs.
        outputs: what it does to the outputs.
    """

    image: Tensor
    out_image: Tensor

    def __init__(self, layer: nn.Linear, inputs: SignedPermutation, outputs: SignedPermutation):
        super().__init__(layer.in_features, layer.out_features)
        _keep(self, layer.weight * 2**0.5, layer.bias, inputs)  # half of the variance is lost by the mean
        self.register_buffer("out_image", _matrix(outputs), persistent=False)

    def whole(self) -> tuple[Tensor, Tensor]:
        """Weights ``(K, I)`` and biases ``(K,)``."""
        mirrored = self.out_image @ self.weight @ self.image
        return (self.weight + mirrored) / 2, (self.bias + self.out_image @ self.bias) / 2

    def own_gradients(self, weight: Tensor, bias: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients by the whole weights and biases to those by its own."""
        mirrored = self.out_image @ weight @ self.image
        return (weight + mirrored) / 2, (bias + self.out_image @ bias) / 2

    def forward(self, observation: Tensor) -> Tensor:
        """``(..., I)`` to ``(..., K)``."""
        return linear(observation, *self.whole())


def _keep(layer: nn.Linear, weight: Tensor, bias: Tensor, inputs: SignedPermutation) -> None:
    with torch.no_grad():
        layer.weight.copy_(weight)
        layer.bias.copy_(bias)
    layer.register_buffer("image", _matrix(inputs), persistent=False)


def _matrix(permutation: SignedPermutation) -> Tensor:
    """The mirror image as a symmetric matrix: its product is exact and its gradient cheaper than that of an index."""
    return torch.from_numpy(permutation(np.eye(len(permutation.order), dtype=np.float32)))


def make_equivariant(network: nn.Sequential, inputs: SignedPermutation, outputs: SignedPermutation) -> None:
    """Replace the linear layers of an MLP, in place.

    Args:
        network: its hidden layers have even widths.
        inputs: what the mirror image does to the inputs.
        outputs: what it does to the outputs.
    """
    layers = [name for name, layer in network.named_children() if isinstance(layer, nn.Linear)]
    for name in layers[:-1]:
        layer = network.get_submodule(name)
        assert isinstance(layer, nn.Linear)
        network.set_submodule(name, PairedLinear(layer, inputs))
        inputs = _halves_swapped(layer.out_features)
    last = network.get_submodule(layers[-1])
    assert isinstance(last, nn.Linear)
    network.set_submodule(layers[-1], MirroredLinear(last, inputs, outputs))


def _halves_swapped(width: int) -> SignedPermutation:
    half = width // 2
    return SignedPermutation((*range(half, width), *range(half)), (1.0,) * width)


@torch.no_grad()
def plain_weights(network: nn.Module) -> dict[str, Tensor]:
    """The state dict of ``plain_copy(network)``."""
    weights = dict(network.state_dict())
    for name, layer in network.named_modules():
        if isinstance(layer, PairedLinear | MirroredLinear):
            weights[f"{name}.weight"], weights[f"{name}.bias"] = layer.whole()
    return weights


def plain_copy(network: nn.Module) -> nn.Module:
    """A copy that computes the same with ordinary layers, which acts faster and is all that a checkpoint needs."""
    copy = deepcopy(network)
    for name, layer in network.named_modules():
        if isinstance(layer, PairedLinear | MirroredLinear):
            rows, columns = layer.whole()[0].shape
            copy.set_submodule(name, skip_init(nn.Linear, columns, rows))
    copy.load_state_dict(plain_weights(network))
    return copy
