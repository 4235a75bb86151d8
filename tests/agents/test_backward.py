"""Gradients that are written out are autograd's; where they are not, autograd gives them."""

from typing import Any

import pytest
import torch
from torch import Tensor, nn

from ibe_rl.agents.actions import GaussianNetwork
from ibe_rl.agents.backward import differentiated
from ibe_rl.agents.equivariant import MirroredSpaces
from ibe_rl.agents.networks import make_network
from ibe_rl.agents.standardise import Standardiser
from ibe_rl.task import IMAGE, NUMBERS, Part
from ibe_rl.task.mirror import SignedPermutation

SPACES = MirroredSpaces(SignedPermutation((0, 1, 3, 2), (-1, 1, 1, 1)), SignedPermutation((0, 2, 1), (1, -1, -1)))


@pytest.fixture(autouse=True)
def repeatable() -> None:
    torch.manual_seed(0)


def by_autograd(network: nn.Module, observation: Tensor, by_outputs: Tensor) -> tuple[Tensor, Any]:
    outputs = network(observation)
    return outputs.detach(), list(torch.autograd.grad(outputs, list(network.parameters()), by_outputs))


def assert_the_same(network: nn.Module, observation: Tensor, outputs: int) -> None:
    network, observation, by_outputs = network.double(), observation.double(), torch.randn(len(observation), outputs)
    for one in network.parameters():
        nn.init.normal_(one)  # biases too
    found, backward = differentiated(network)(observation)
    assert not found.requires_grad
    torch.testing.assert_close((found, backward(by_outputs.double())), by_autograd(network, observation, by_outputs))


def refuse(*_: Any) -> None:
    raise AssertionError("autograd was asked")


@pytest.mark.parametrize("hidden", [[8], [8, 6, 4]])
@pytest.mark.parametrize("mirror", [None, SPACES], ids=["plain", "mirrored"])
@pytest.mark.parametrize("ignored", [[], [1]], ids=["all", "ignored"])
@pytest.mark.parametrize("standardised", [False, True], ids=["as they are", "standardised"])
@pytest.mark.parametrize("continuous", [False, True], ids=["choices", "continuous"])
def test_gradients_are_autograds(
    hidden: list[int], mirror: Any, ignored: list[int], standardised: bool, continuous: Any
):
    standardiser = Standardiser(4, [Part("", NUMBERS, (4,))], standardised, mirror)
    observation = 5 * torch.randn(30, 4) + 7
    standardiser.learn(observation)
    network: nn.Module = make_network(
        4, hidden, 3, nn.ReLU, 1.0, ignored=ignored, standardiser=standardiser, mirror=mirror
    )
    assert_the_same(GaussianNetwork(network, 3, 0.5) if continuous else network, observation, 6 if continuous else 3)


def test_an_mlp_does_without_autograd(monkeypatch: pytest.MonkeyPatch):
    network = make_network(4, [8], 3, nn.ReLU, 1.0, ignored=[0], standardiser=Standardiser(4, [], None), mirror=SPACES)
    outputs, backward = differentiated(GaussianNetwork(network, 3, 0.5))(torch.randn(5, 4))
    monkeypatch.setattr("torch.autograd.grad", refuse)
    shapes = [one.shape for one in backward(torch.ones_like(outputs))]
    assert shapes == [(3,), (4, 4), (4,), (3, 8), (3,)]


@pytest.mark.parametrize("continuous", [False, True], ids=["choices", "continuous"])
def test_a_network_that_reads_images_keeps_autograd(monkeypatch: pytest.MonkeyPatch, continuous: bool):
    parts = [Part("picture", IMAGE, (6, 8, 3))]
    image: nn.Module = make_network(145, [8], 3, nn.ReLU, 1.0, parts=parts, standardiser=Standardiser(145, parts, None))
    image = GaussianNetwork(image, 3, 0.5) if continuous else image
    assert_the_same(image, 255 * torch.rand(5, 145), 6 if continuous else 3)
    _, backward = differentiated(image)(torch.rand(5, 145).double())
    monkeypatch.setattr("torch.autograd.grad", refuse)
    with pytest.raises(AssertionError, match="autograd was asked"):
        backward(torch.ones(5, 6 if continuous else 3).double())


def test_other_activations_keep_autograd():
    assert_the_same(make_network(4, [8], 3, nn.Tanh, 1.0), torch.randn(30, 4), 3)


def test_the_gradients_of_one_layer_by_hand():
    """Rows (1, 2) and (3, 4), output by output: weighted sums of the rows, and the sums of the weights."""
    network = nn.Sequential(nn.Linear(2, 2))
    _, backward = differentiated(network)(torch.tensor([[1.0, 2.0], [3.0, 4.0]]))
    weight, bias = backward(torch.tensor([[1.0, 0.0], [1.0, -1.0]]))
    assert weight.tolist() == [[4, 6], [-3, -4]]
    assert bias.tolist() == [2, -1]
