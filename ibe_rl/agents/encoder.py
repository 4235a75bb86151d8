"""Images in observations: their convolutions, and their compact storage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from torch import Tensor, nn
from torchrl.modules import ConvNet

from ibe_rl.task import IMAGE, Part

FEATURES = 128
"""Numbers that an image becomes."""
SMALL_PIXELS = 36
"""Images below this many pixels in a direction get small convolutions."""


def has_images(parts: Sequence[Part]) -> bool:
    """Whether one of the parts is an image."""
    return any(part.kind == IMAGE for part in parts)


def encoded_size(inputs: int, parts: Sequence[Part]) -> int:
    """How many numbers observations have once their images are encoded."""
    return inputs + sum(FEATURES - part.size for part in parts if part.kind == IMAGE)


class ImageEncoder(nn.Module):
    """Encodes one image: TorchRL's ``ConvNet``, sized as by Mnih et al. (2015) or small, and a linear layer."""

    def __init__(self, part: Part):
        super().__init__()
        height, width, channels = part.shape
        self._shape = (channels, height, width) if part.channels_first else part.shape
        self._channels_first = part.channels_first
        small = min(height, width) < SMALL_PIXELS
        self.convolutions = ConvNet(
            in_features=channels,
            num_cells=[16, 32, 64] if small else [32, 64, 64],
            kernel_sizes=[3, 3, 3] if small else [8, 4, 3],
            strides=[1, 2, 2] if small else [4, 2, 1],
            paddings=1 if small else 0,
            activation_class=nn.ReLU,
        )
        with torch.no_grad():
            found = self.convolutions(torch.zeros(channels, height, width)).shape[-1]
        self.features = nn.Sequential(nn.Linear(found, FEATURES), nn.ReLU())
        for layer in [*self.convolutions, self.features[0]]:
            if isinstance(layer, nn.Conv2d | nn.Linear):
                nn.init.orthogonal_(layer.weight, 2**0.5)
                assert layer.bias is not None
                nn.init.zeros_(layer.bias)

    def forward(self, row: Tensor) -> Tensor:
        """Images as rows ``(..., height * width * channels)`` to features ``(..., FEATURES)``."""
        image = row.unflatten(-1, self._shape)
        found: Tensor = self.features(self.convolutions(image if self._channels_first else image.movedim(-1, -3)))
        return found


class Encoder(nn.Module):
    """Replaces the images in observations by features; all other numbers follow these as they are.

    Args:
        inputs: ``O``.
        parts: of the leading inputs.
    """

    def __init__(self, inputs: int, parts: Sequence[Part]):
        super().__init__()
        self._places = [place for place, _ in _images(parts)]
        self._others = others(inputs, parts)
        self.images = nn.ModuleList(ImageEncoder(part) for _, part in _images(parts))

    def forward(self, observation: Tensor) -> Tensor:
        """Observations ``(..., O)`` to ``(..., encoded_size)``."""
        features = [image(observation[..., at]) for image, at in zip(self.images, self._places, strict=True)]
        return torch.cat([*features, observation[..., self._others]], dim=-1)


def _images(parts: Sequence[Part]) -> Iterator[tuple[slice, Part]]:
    """The images, with their places in an observation."""
    start = 0
    for part in parts:
        if part.kind == IMAGE:
            yield slice(start, start + part.size), part
        start += part.size


def others(inputs: int, parts: Sequence[Part]) -> Tensor:
    """Places ``(R,)`` in an observation that belong to no image."""
    free = torch.ones(inputs, dtype=torch.bool)
    for place, _ in _images(parts):
        free[place] = False
    return free.nonzero().squeeze(-1)


class Packing:
    """Keeps images of observations as bytes.

    Args:
        inputs: ``O``.
        parts: of the leading inputs.
    """

    def __init__(self, inputs: int, parts: Sequence[Part]):
        self._others, self._inputs = others(inputs, parts), inputs
        self._bytes = torch.ones(inputs, dtype=torch.bool).index_fill(0, self._others, False).nonzero().squeeze(-1)

    def pack(self, observations: Tensor) -> dict[str, Tensor]:
        """``(N, O)`` to the images and all other numbers."""
        return {"bytes": observations[:, self._bytes].byte(), "numbers": observations[:, self._others]}

    def unpack(self, packed: dict[str, Tensor]) -> Tensor:
        """The inverse of ``pack``."""
        found = packed["numbers"].new_empty(len(packed["numbers"]), self._inputs)
        found[:, self._bytes], found[:, self._others] = packed["bytes"].float(), packed["numbers"]
        return found
