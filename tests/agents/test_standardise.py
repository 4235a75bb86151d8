"""Observations and rewards are standardised where their scales need it, and left alone, bit for bit, where not."""

import numpy as np
import pytest
import torch
from torch import nn

from ibe_rl.agents.networks import make_network
from ibe_rl.agents.standardise import BYTE, LIMIT, MOST, RewardStandardiser, Standardiser, standardised
from ibe_rl.task import FLAGS, IMAGE, NUMBERS, Part

ROWS = [Part("", NUMBERS, (2,))]
SOME = torch.randn(500, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float32)
"""Two numbers, an instruction and whether it was given."""


def scaled(*factors: float, middle: float = 0.0) -> torch.Tensor:
    rows = SOME.clone()
    rows[:, :2] = rows[:, :2] * torch.tensor(factors) + middle
    return rows


@pytest.mark.parametrize(
    ("rows", "on"),
    [
        (scaled(1, 1), False),
        (scaled(10, 0.1), False),
        (scaled(100, 1), True),
        (scaled(1, 0.001), True),
        (scaled(1, 0), False),  # a constant number has no scale
        (scaled(1, 1, middle=1e6), True),
    ],
)
def test_the_first_batch_decides(rows: torch.Tensor, on: bool):
    one = Standardiser(4, ROWS, None)
    assert one.learn(rows) is on
    assert bool(one.on) is on
    assert not one.learn(scaled(1000, 1000))  # decided
    assert bool(one.on) is on
    assert standardised(one, RewardStandardiser(None, 0.9)) == (["observations"] if on else [])
    if not on:
        assert one(rows) is rows


def test_rare_flags_and_what_follows_the_parts_decide_nothing():
    rows = scaled(1, 1)
    rows[:, 1] = 0
    rows[0, 1] = 1  # deviation below the limit, but only 0 or 1
    assert not Standardiser(4, ROWS, None).learn(rows)
    rows = scaled(1, 1)
    rows[:, 2] *= 1e6
    assert not Standardiser(4, ROWS, None).learn(rows)


def test_asked_for_is_done_and_forbidden_is_not():
    assert Standardiser(4, ROWS, True).learn(SOME)
    assert not Standardiser(4, ROWS, False).learn(scaled(1e6, 1))
    assert not Standardiser(4, [], True).learn(SOME)  # nothing to standardise
    assert not Standardiser(4, [Part("", FLAGS, (2,))], True).learn(SOME)


def test_running_values_are_those_of_all_rows_seen():
    one, batches = Standardiser(4, ROWS, True), scaled(50, 3, middle=7).split([100, 150, 250])
    for batch in batches:
        one.learn(batch)
    rows = scaled(50, 3, middle=7).double()
    torch.testing.assert_close(one.mean[:2], rows[:, :2].mean(dim=0))
    torch.testing.assert_close(one.var[:2], rows[:, :2].var(dim=0, correction=0))
    out = one(rows.float())
    torch.testing.assert_close(out[:, :2].mean(dim=0), torch.zeros(2), atol=1e-4, rtol=0)
    torch.testing.assert_close(out[:, :2].std(dim=0, correction=0), torch.ones(2), atol=1e-3, rtol=0)
    torch.testing.assert_close(out[:, 2:], rows[:, 2:].float())
    assert one(rows.float() * 1000).abs().max() == LIMIT


@pytest.mark.parametrize("channels_first", [False, True])
def test_images_are_bytes_or_standardised_by_channel(channels_first: bool):
    image = torch.zeros(50, 4, 5, 3)
    image[..., 0] = 10 + 5 * torch.randn(50, 4, 5, generator=torch.Generator().manual_seed(1))
    image[..., 1] = 200
    rows = (image.movedim(-1, 1) if channels_first else image).flatten(1)
    part = Part("", IMAGE, (4, 5, 3), channels_first)
    off = Standardiser(60, [part], False)
    torch.testing.assert_close(off(rows), rows / BYTE)
    on = Standardiser(60, [part], True)
    on.learn(rows)
    assert on.mean[1:3].tolist() == [200, 0]
    torch.testing.assert_close(on.mean[0], image[..., 0].double().mean())
    shape = (3, 4, 5) if channels_first else (4, 5, 3)
    out = on(rows).unflatten(1, shape)
    channel = out[:, 0] if channels_first else out[..., 0]
    torch.testing.assert_close(channel.std(), torch.tensor(1.0), atol=0.01, rtol=0)


def test_codes_in_an_image_are_small_numbers_whatever_its_empty_pixels():
    codes = torch.randint(0, 5, (60, 48), generator=torch.Generator().manual_seed(3)).float()
    codes[:, :9] = 0
    assert Standardiser(48, [Part("", IMAGE, (4, 4, 3))], None).learn(codes)
    assert not Standardiser(48, [Part("", IMAGE, (4, 4, 3))], None).learn(codes * 50)


def test_it_is_kept_with_the_weights_and_older_weights_have_none():
    one, other = (make_network(4, [8], 1, nn.ReLU, 1.0, standardiser=Standardiser(4, ROWS, True)) for _ in range(2))
    one[0].learn(scaled(100, 1))
    other.load_state_dict(one.state_dict())
    assert torch.equal(other(SOME), one(SOME))
    older = make_network(4, [8], 1, nn.ReLU, 1.0)
    other.load_state_dict(older.state_dict())
    assert torch.equal(other(SOME), older(SOME))
    assert not other[0].learn(scaled(100, 1))  # it stays as it was trained


def test_rewards_are_divided_by_the_deviation_of_the_returns():
    one, rewards = RewardStandardiser(True, 0.5), torch.tensor([[8.0, 8.0, 0.0], [0.0, 0.0, 0.0]])[..., None]
    done = torch.tensor([[False, True, False], [False, False, False]])[..., None]
    one.learn(rewards, done)
    returns = np.array([8, 12, 0, 0, 0, 0])
    assert one.factor == pytest.approx(1 / returns.std())
    one.learn(rewards, done)
    returns = np.array([8, 12, 0, 0, 0, 0, 8, 12, 0, 0, 0, 0])
    assert one.factor == pytest.approx(1 / returns.std())
    again = RewardStandardiser(True, 0.5)
    again.load_state_dict(one.state_dict())
    one.learn(rewards, done)
    again.learn(rewards, done)
    assert again.factor == one.factor != 1


@pytest.mark.parametrize(
    ("wanted", "size", "on"),
    [(None, 1.0, False), (None, 10 * MOST, True), (None, 1e-4, True), (True, 1.0, True), (False, 1e6, False)],
)
def test_the_first_returns_that_differ_decide(wanted: bool | None, size: float, on: bool):
    one, none = RewardStandardiser(wanted, 0.9), torch.zeros(4, 8, 1)
    one.learn(none, none.bool())
    assert not one.on
    one.learn(size * torch.randn(4, 8, 1, generator=torch.Generator().manual_seed(2)), none.bool())
    assert one.on is on
    assert (one.factor != 1) is on
    assert standardised(Standardiser(4, ROWS, False), one) == (["rewards"] if on else [])


def test_rewards_of_an_older_checkpoint_stay_as_they_are():
    one = RewardStandardiser(None, 0.9)
    one.load_state_dict(None)
    one.learn(1e6 * torch.randn(4, 8, 1), torch.zeros(4, 8, 1, dtype=torch.bool))
    assert one.factor == 1
