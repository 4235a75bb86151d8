"""Adam on one tensor takes the steps of Adam on each parameter, and goes on from either's state."""

from copy import deepcopy
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from ibe_rl.agents.flat_adam import FlatAdam


def parameters() -> list[nn.Parameter]:
    random = torch.Generator().manual_seed(0)
    return [nn.Parameter(torch.randn(shape, generator=random)) for shape in ((3, 2), (3,), ())]


def gradients(seed: int) -> list[Tensor]:
    random = torch.Generator().manual_seed(seed)
    return [torch.randn(one.shape, generator=random) for one in parameters()]


def separate(learnt: list[nn.Parameter], optimizer: torch.optim.Adam, seed: int, max_norm: float | None) -> None:
    for one, gradient in zip(learnt, gradients(seed), strict=True):
        one.grad = gradient
    if max_norm is not None:
        nn.utils.clip_grad_norm_(learnt, max_norm)
    optimizer.step()


@pytest.mark.parametrize("max_norm", [None, 0.5, 100.0])
def test_steps_are_those_of_adam_on_each_parameter(max_norm: float | None):
    flat, apart = parameters(), parameters()
    one, each = FlatAdam(flat, 0.01, eps=1e-5), torch.optim.Adam(apart, lr=0.01, eps=1e-5)
    for seed in range(5):
        one.param_groups[0]["lr"] = each.param_groups[0]["lr"] = 0.01 / (seed + 1)
        one.descend(gradients(seed), max_norm)
        separate(apart, each, seed, max_norm)
    torch.testing.assert_close(flat, apart)
    assert not torch.equal(flat[0], parameters()[0])


def test_the_first_step_by_hand():
    """It is the learning rate in the direction of each gradient, whatever its size."""
    learnt = [nn.Parameter(torch.tensor([1.0, 2.0])), nn.Parameter(torch.tensor([[3.0]]))]
    FlatAdam(learnt, 0.5).descend([torch.tensor([10.0, -0.1]), torch.tensor([[0.01]])])
    assert learnt[0].tolist() == pytest.approx([0.5, 2.5])
    assert learnt[1].tolist() == [[pytest.approx(2.5)]]


def test_loaded_weights_are_those_that_are_learnt():
    network = nn.Linear(2, 1)
    optimizer, copy = FlatAdam(network.parameters(), 0.5), deepcopy(network)
    network.load_state_dict({"weight": torch.tensor([[1.0, 2.0]]), "bias": torch.tensor([3.0])})
    optimizer.descend([torch.ones(1, 2), torch.ones(1)])
    assert optimizer.flat.tolist() == pytest.approx([0.5, 1.5, 2.5])
    assert network.bias.item() == pytest.approx(2.5)
    optimizer.descend([torch.ones(1, 2), torch.ones(1)])
    assert not any(torch.equal(one, other) for one, other in zip(copy.parameters(), network.parameters(), strict=True))


def goes_on(optimizer: Any, state: dict[str, Any]) -> Any:
    optimizer.load_state_dict(state)
    return optimizer


@pytest.mark.parametrize("steps", [0, 3])
def test_it_goes_on_from_its_state(steps: int):
    learnt = parameters()
    optimizer = FlatAdam(learnt, 0.01)
    for seed in range(steps):
        optimizer.descend(gradients(seed))
    resumed = deepcopy(learnt)
    other = goes_on(FlatAdam(resumed, 1.0), deepcopy(optimizer.state_dict()))
    for one in (optimizer, other):
        one.descend(gradients(9))
    assert all(torch.equal(one, again) for one, again in zip(learnt, resumed, strict=True))
    assert other.param_groups[0]["lr"] == 0.01


@pytest.mark.parametrize("steps", [0, 3])
def test_it_goes_on_from_the_state_of_an_earlier_version(steps: int):
    """It had a state for each parameter."""
    learnt = parameters()
    optimizer = torch.optim.Adam(learnt, lr=0.01, fused=True)
    for seed in range(steps):
        separate(learnt, optimizer, seed, None)
    resumed = deepcopy(learnt)
    other = goes_on(FlatAdam(resumed, 1.0), deepcopy(optimizer.state_dict()))
    other.descend(gradients(9))
    separate(learnt, optimizer, 9, None)
    torch.testing.assert_close(resumed, learnt)
    assert other.param_groups[0]["lr"] == 0.01
