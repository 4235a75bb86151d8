"""Networks that are equivariant under a mirror image, exactly and from the first step, also while they learn."""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torch import Tensor, nn

from ibe_rl.agents import make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.equivariant import MirroredSpaces, plain_copy
from ibe_rl.agents.networks import make_network
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.task.mirror import Mirror, SignedPermutation

NAMES = ("x", "height", "left", "right")
MIRROR = Mirror(flipped=("x",), swapped=(("left", "right"),), actions=(0, 2, 1))
SPACES = MirroredSpaces(MIRROR.of_observations(NAMES), MIRROR.of_actions())
ACTIONS = gymnasium.spaces.Discrete(3)


def image(rows: Tensor, of: SignedPermutation) -> Tensor:
    return torch.from_numpy(of(rows.numpy()))


def assert_equivariant(network: Any, observations: Tensor) -> None:
    with torch.no_grad():
        outputs = network(observations)
        mirrored = network(image(observations, SPACES.observations))
    assert outputs.std() > 0
    torch.testing.assert_close(mirrored, image(outputs, SPACES.outputs))


def random_batch(seed: int, scale: float = 1.0) -> TensorDict:
    numbers = torch.Generator().manual_seed(seed)
    observations = scale * torch.randn(4, 33, 6, generator=numbers)
    observations[..., 0] += 3 * scale  # always on one side
    no = torch.zeros(4, 32, 1, dtype=torch.bool)
    return TensorDict(
        {
            "observation": observations[:, :-1],
            "action": torch.randint(3, (4, 32), generator=numbers),
            "action_log_prob": torch.full((4, 32), -1.0986),
            "next": {
                "observation": observations[:, 1:],
                "reward": torch.randn(4, 32, 1, generator=numbers),
                "done": no,
                "terminated": no,
                "success": no,
            },
        },
        [4, 32],
    )


@pytest.mark.parametrize("hidden", [[8], [8, 6], [4, 4, 4]])
def test_a_network_gives_the_mirrored_outputs_of_mirrored_inputs(hidden: list[int]):
    torch.manual_seed(0)
    network = make_network(6, hidden, 3, nn.ReLU, 1.0, mirror=SPACES)
    assert_equivariant(network, torch.randn(50, 6))
    value = make_network(6, hidden, 1, nn.ReLU, 1.0, mirror=SPACES.of_value())
    observations = torch.randn(50, 6)
    torch.testing.assert_close(value(observations), value(image(observations, SPACES.observations)))


def test_what_acts_is_an_ordinary_network_that_computes_the_same():
    torch.manual_seed(0)
    network = make_network(6, [8, 8], 3, nn.ReLU, 1.0, ignored=[1], mirror=SPACES)
    plain, observations = plain_copy(network), torch.randn(50, 6)
    torch.testing.assert_close(plain(observations), network(observations))
    assert {type(layer) for layer in plain.modules() if isinstance(layer, nn.Linear)} == {nn.Linear}
    assert network[1][0].weight.shape == (4, 6)
    assert plain[1][0].weight.shape == (8, 6)


@pytest.mark.parametrize("config", [PPOConfig(mirror=True), DQNConfig(mirror=True, learn_after_frames=0)])
def test_the_policy_of_a_mirrored_agent_opens_like_any_other(config: Any):
    torch.manual_seed(0)
    agent = make_agent(config, 6, ACTIONS, 10_000, NAMES, mirror=MIRROR)
    agent.update(random_batch(0))
    opened = make_agent(config, 6, ACTIONS, 10_000, NAMES).greedy
    opened.load_state_dict(agent.greedy.state_dict())
    observations = random_batch(1)["observation"].flatten(0, 1).numpy()
    assert np.array_equal(opened(observations), agent.greedy(observations))


def test_a_network_can_tell_one_side_from_the_other():
    """As any network: its actions at two different sides differ, though they are tied."""
    torch.manual_seed(0)
    network = make_network(6, [16, 16], 3, nn.ReLU, 1.0, mirror=SPACES)
    optimizer = torch.optim.Adam(network.parameters(), lr=0.01)
    observations = torch.randn(400, 6)
    wanted = torch.where(observations[:, 0] > 0, 1, 2)  # the action towards the middle
    for _ in range(200):
        optimizer.zero_grad()
        nn.functional.cross_entropy(network(observations), wanted).backward()
        optimizer.step()
    assert (network(observations).argmax(-1) == wanted).float().mean() > 0.97


@pytest.mark.parametrize("scale", [1.0, 1000.0])  # of large numbers observations are standardised
@pytest.mark.parametrize("config", [PPOConfig(mirror=True), DQNConfig(mirror=True, learn_after_frames=0)])
def test_agents_stay_equivariant_whatever_they_learn(config: Any, scale: float):
    torch.manual_seed(0)
    config.hidden = [16, 16]
    agent = make_agent(config, 6, ACTIONS, 10_000, NAMES, mirror=MIRROR)
    for seed in range(4):
        losses = agent.update(random_batch(seed, scale))
    assert np.isfinite(list(losses.values())).all()
    assert agent.standardised == (["observations"] if scale > 1 else [])
    network = agent._actor if isinstance(config, PPOConfig) else agent._network
    assert_equivariant(network, scale * torch.randn(50, 6))
    observations = random_batch(9, scale)["observation"].flatten(0, 1)
    with torch.no_grad():
        best, second = agent.greedy._average.module(observations).topk(2).values.unbind(-1)
    clear = observations[best - second > 1e-6].numpy()  # where both sides are as good, the first action is taken
    assert len(clear) > 100
    images = SPACES.observations(clear)
    assert np.array_equal(agent.greedy(images), np.array(MIRROR.actions)[agent.greedy(clear)])


def test_continuous_actions_are_mirrored():
    torch.manual_seed(0)
    box = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
    throttles = Mirror(("x",), (("left", "right"),), action_signs=(1.0, -1.0))
    agent = make_agent(PPOConfig(mirror=True, hidden=[8, 8]), 6, box, 100, NAMES, mirror=throttles)
    observations = torch.randn(20, 6).numpy()
    actions = agent.greedy(observations)
    np.testing.assert_allclose(agent.greedy(SPACES.observations(observations)), actions * [1, -1], atol=1e-6)


def test_without_the_setting_nothing_is_mirrored():
    torch.manual_seed(0)
    agent = make_agent(PPOConfig(mirror=False), 6, ACTIONS, 100, NAMES, mirror=MIRROR)
    torch.manual_seed(0)
    plain = make_agent(PPOConfig(), 6, ACTIONS, 100, NAMES)
    for name, weights in agent.state_dict()["actor"].items():
        assert torch.equal(weights, plain.state_dict()["actor"][name])
