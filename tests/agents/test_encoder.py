"""Images go through convolutions and come back from the buffer as they were; the instruction joins behind them."""

import pytest
import torch
from torch import nn

from ibe_rl.agents.encoder import FEATURES, Encoder, Packing, encoded_size, has_images
from ibe_rl.agents.networks import make_network
from ibe_rl.task import FLAGS, IMAGE, NUMBERS, Part

PARTS = [Part("way", FLAGS, (3,)), Part("left", IMAGE, (7, 7, 3)), Part("speed", NUMBERS, (2,))]
PARTS += [Part("right", IMAGE, (40, 36, 1), channels_first=True)]
SIZE = sum(part.size for part in PARTS) + 2
ROWS = torch.randint(0, 256, (5, SIZE), generator=torch.Generator().manual_seed(0)).float()


def test_each_image_becomes_features_and_the_rest_stays():
    encoder = Encoder(SIZE, PARTS)
    out = encoder(ROWS)
    assert out.shape == (5, encoded_size(SIZE, PARTS)) == (5, 2 * FEATURES + 3 + 2 + 2)
    rest = torch.cat([ROWS[:, :3], ROWS[:, 150:152], ROWS[:, -2:]], dim=1)
    assert torch.equal(out[:, 2 * FEATURES :], rest)
    torch.testing.assert_close(
        encoder(ROWS.expand(2, 5, SIZE))[1], out, atol=1e-2, rtol=1e-3
    )  # steps of several environments
    others = ROWS.clone()
    others[:, 3:150] = 0  # the left image
    assert not torch.equal(encoder(others)[:, :FEATURES], out[:, :FEATURES])
    assert torch.equal(encoder(others)[:, FEATURES:], out[:, FEATURES:])


def test_channels_are_found_wherever_they_are():
    last, first = (Part("", IMAGE, (8, 9, 3), channels_first=place) for place in (False, True))
    torch.manual_seed(0)
    one = Encoder(216, [last])
    other = Encoder(216, [first])
    other.load_state_dict(one.state_dict())
    image = torch.rand(4, 8, 9, 3)
    torch.testing.assert_close(one(image.flatten(1)), other(image.movedim(-1, 1).flatten(1)))


@pytest.mark.parametrize("shape", [(1, 1, 3), (2, 50, 1), (3, 3, 4), (36, 36, 1), (96, 96, 3)])
def test_any_size_works(shape: tuple[int, int, int]):
    part = Part("", IMAGE, shape)
    assert Encoder(part.size + 2, [part])(torch.zeros(2, part.size + 2)).shape == (2, FEATURES + 2)


def test_the_network_learns_through_the_image():
    network = make_network(SIZE, [8], 2, nn.ReLU, 1.0, parts=PARTS)
    network(ROWS / 255).sum().backward()
    assert all(weights.grad is not None and weights.grad.abs().sum() > 0 for weights in network[0].parameters())
    assert has_images(PARTS)
    assert not has_images([PARTS[0], PARTS[2]])


def test_images_are_kept_as_bytes_without_loss():
    packing, rows = Packing(SIZE, PARTS), ROWS.clone()
    rows[:, 150:152] /= 7
    packed = packing.pack(rows)
    assert packed["bytes"].dtype == torch.uint8
    assert packed["bytes"].shape[1] + packed["numbers"].shape[1] == SIZE
    assert torch.equal(packing.unpack(packed), rows)
