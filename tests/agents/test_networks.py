"""The parts that agents share: their networks, the greedy average, schedules, and losses that are no numbers."""

import pytest
import torch
from torch import nn

from ibe_rl.agents import GreedyPolicy
from ibe_rl.agents.networks import check_finite, linear, make_network


def test_linear():
    assert [linear(1.0, 0.2, progress) for progress in (-1, 0, 0.5, 1, 7)] == pytest.approx([1, 1, 0.6, 0.2, 0.2])


def test_the_greedy_policy_is_an_average_of_the_weights():
    network = make_network(2, [4], 3, nn.Tanh, last_gain=1.0)

    def followed(share: float) -> list[float]:
        policy, shown = GreedyPolicy(network, share), []
        for value in (1.0, 2.0, 4.0):
            nn.init.constant_(network[-1].bias, value)
            policy.follow(network)
            shown.append(policy.state_dict()["module.2.bias"][0].item())
        return shown

    assert followed(0.0) == [1, 2, 4]
    assert followed(0.5) == pytest.approx([1, 5 / 3, 17 / 6])  # two thirds of the way, then half
    assert followed(1.0) == pytest.approx([1, 3 / 2, 7 / 3])  # the mean of all


def test_a_network_begins_orthogonal_with_its_last_gain():
    network = make_network(6, [5, 5], 3, nn.ReLU, last_gain=0.01)
    layers = [layer for layer in network if isinstance(layer, nn.Linear)]
    assert [layer.weight.shape for layer in layers] == [(5, 6), (5, 5), (3, 5)]
    for layer, gain in zip(layers, (2**0.5, 2**0.5, 0.01), strict=True):
        torch.testing.assert_close(layer.weight @ layer.weight.T, gain**2 * torch.eye(len(layer.weight)))
        assert not layer.bias.any()


@pytest.mark.parametrize("losses", [{"loss": float("nan")}, {"fine": 0.0, "loss": float("inf")}])
def test_a_loss_that_is_no_number_is_named(losses: dict[str, float]):
    with pytest.raises(FloatingPointError, match=rf"^loss={losses['loss']}$"):
        check_finite(losses, [])


@pytest.mark.parametrize("value", [float("nan"), float("-inf")])
def test_weights_that_are_no_numbers_are_found(value: float):
    weights = [torch.zeros(3), torch.zeros(2, 2)]
    check_finite({"loss": 1.0}, weights)
    weights[1][1, 0] = value
    with pytest.raises(FloatingPointError, match=r"^weights are not finite numbers$"):
        check_finite({"loss": 1.0}, weights)
