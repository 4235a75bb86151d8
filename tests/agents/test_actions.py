"""Draws, densities, bounds and modes of both kinds of actions, by hand; and what kinds there are."""

import math
from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete, MultiBinary, MultiDiscrete
from tensordict import TensorDict
from torch import nn

from ibe_rl.agents import Agent, make_agent
from ibe_rl.agents.actions import RAW_ACTION, Categorical, Gaussian, GaussianNetwork, make_actions
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.types import ConfigError

BOX = Box(np.array([-1, 0], np.float32), np.array([1, 10], np.float32))


@pytest.fixture(autouse=True)
def repeatable() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


def normal() -> Gaussian:
    """One number in [-1, 1], one in [0, 10]."""
    made = make_actions(BOX, 0.5)
    assert isinstance(made, Gaussian)
    return made


def test_log_probability_and_entropy_by_hand():
    """Deviations 1 and 1/2; one draw at the means, one a deviation off in the first and two in the second number."""
    outputs = torch.tensor([[0.3, -0.2, 0.0, -math.log(2)]]).repeat(2, 1)
    log_prob, entropy = normal().evaluate_actions(outputs, torch.tensor([[0.3, -0.2], [1.3, 0.8]]))
    top = math.log(1 / math.sqrt(2 * math.pi)) + math.log(2 / math.sqrt(2 * math.pi))
    assert log_prob.tolist() == pytest.approx([top, top - 1 / 2 - 2])
    assert entropy.tolist() == pytest.approx(2 * [math.log(2 * math.pi * math.e) - math.log(2)])


def test_probability_and_entropy_of_a_choice_by_hand():
    outputs = torch.tensor([[0.0, math.log(3)]]).repeat(2, 1)
    log_prob, entropy = Categorical(2).evaluate_actions(outputs, torch.tensor([0, 1]))
    assert log_prob.exp().tolist() == pytest.approx([0.25, 0.75])
    assert entropy.tolist() == pytest.approx(2 * [-0.25 * math.log(0.25) - 0.75 * math.log(0.75)])


@pytest.mark.parametrize("space", [Discrete(3, start=4), MultiDiscrete([3, 2], start=[1, 0]), BOX])
def test_the_gradient_by_the_outputs_is_autograds(space: Any):
    actions = make_actions(space, 0.5)
    outputs = torch.randn(20, 4 if space is BOX else actions.outputs, dtype=torch.double, requires_grad=True)
    by_log_prob, by_entropy = torch.randn(20).double(), 0.7
    drawn = actions.draw(outputs.detach())[actions.learnt_from]
    log_prob, entropy = actions.evaluate_actions(outputs, drawn)
    (by_log_prob @ log_prob + by_entropy * entropy.sum()).backward()
    torch.testing.assert_close(actions.gradient(outputs.detach(), drawn, by_log_prob, by_entropy), outputs.grad)


def test_the_gradient_of_a_choice_by_hand():
    """Of chances 1/4 and 3/4 the log-probability of the first rises by 3/4 with its logit, and falls with the other."""
    outputs = torch.tensor([[0.0, math.log(3)]])
    found = Categorical(2).gradient(outputs, torch.tensor([0]), torch.tensor([2.0]), 0.0)
    assert found.tolist() == [pytest.approx([1.5, -1.5])]
    even = Categorical(2).gradient(torch.zeros(1, 2), torch.tensor([0]), torch.tensor([0.0]), 1.0)
    assert even.tolist() == [[0, 0]]  # no choice is less certain than this one


def test_the_mode_is_the_mean_in_the_environments_units_and_bounds():
    outputs = torch.tensor([[0.5, -0.5, 9, 9], [-3, 3, 0, 0], [0, 0, -9, -9]], dtype=torch.float32)
    mode = normal().mode(outputs)
    assert mode.dtype == torch.float32
    assert mode.tolist() == [[0.5, 2.5], [-1, 10], [0, 5]]
    assert Categorical(3).mode(torch.tensor([[0.0, 2, 1], [3, 2, 1]])).tolist() == [1, 0]


def test_draws_are_put_on_the_bounds_and_learnt_from_as_they_were_drawn():
    actions, outputs = normal(), torch.tensor([[0.9, 0.0, 0.0, -1.0]]).repeat(20_000, 1)
    drawn = actions.draw(outputs)
    assert set(drawn) == {"action", "action_log_prob", RAW_ACTION}
    action, free = drawn["action"].numpy(), drawn[RAW_ACTION]
    assert all(BOX.contains(one) for one in action[:100])
    assert (action.min(axis=0) >= BOX.low).all()
    assert (action.max(axis=0) <= BOX.high).all()
    assert (action[:, 0] == 1).mean() == pytest.approx(0.46, abs=0.02)  # of N(.9, 1) above 1
    assert free.mean(0).tolist() == pytest.approx([0.9, 0], abs=0.03)
    assert free.std(0).tolist() == pytest.approx([1, math.exp(-1)], abs=0.03)
    inside = (free.abs() < 1).all(dim=1).numpy()
    np.testing.assert_allclose(action[inside], ([0, 5] + free.numpy() * [1, 5])[inside], rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(drawn["action_log_prob"], actions.evaluate_actions(outputs, free)[0])


@pytest.mark.parametrize("space", [Discrete(3, start=4), MultiDiscrete([3, 2]), BOX])
def test_given_noise_decides_the_sample_and_leaves_the_probabilities_as_they_are(space: Any):
    actions = make_actions(space, 0.5)
    outputs = torch.randn(1, 4 if space is BOX else actions.outputs).repeat(40_000, 1)
    noise = actions.noise(outputs)
    drawn, again, own = actions.draw(outputs, noise), actions.draw(outputs, noise), actions.draw(outputs)
    for name, value in drawn.items():
        assert torch.equal(value, again[name])
    assert not torch.equal(drawn["action"], own["action"])
    action, its_own = (one[actions.learnt_from].double().reshape(40_000, -1) for one in (drawn, own))
    torch.testing.assert_close(action.mean(0), its_own.mean(0), atol=0.02, rtol=0.01)
    torch.testing.assert_close(action.std(0), its_own.std(0), atol=0.02, rtol=0.01)
    log_prob, _ = actions.evaluate_actions(outputs, drawn[actions.learnt_from])
    torch.testing.assert_close(log_prob, drawn["action_log_prob"])


def test_the_spread_is_the_same_everywhere_and_is_learnt():
    network = GaussianNetwork(nn.Linear(3, 2), 2, first_std=0.5)
    outputs = network(torch.randn(5, 3))
    assert outputs.shape == (5, 4)
    assert outputs[:, 2:].exp().detach().numpy() == pytest.approx(0.5)
    outputs.sum().backward()
    assert network.log_std.grad is not None
    assert network.log_std.grad.tolist() == [5, 5]


@pytest.mark.parametrize(
    "space",
    [
        Box(-np.inf, np.inf, (2,)),
        Box(np.array([-1, -np.inf], np.float32), np.array([1, 1], np.float32)),
        Box(-1, 1, (2, 2)),
        Box(-1, 1, ()),
        Box(0, 255, (2,), np.uint8),
        MultiDiscrete([[2, 2]]),
        MultiBinary([2, 2]),
    ],
    ids=str,
)
def test_other_actions_are_refused(space: gymnasium.Space):
    for config in (PPOConfig(), DQNConfig()):
        with pytest.raises(ConfigError, match=r"env: its actions are .*; allowed are Discrete, or with agent=ppo"):
            make_agent(config, 2, space, 1_000)


def test_dqn_takes_no_continuous_actions():
    with pytest.raises(ConfigError, match=r"^agent=dqn: .* Box\(.*not Discrete; allowed is agent=ppo$"):
        make_agent(DQNConfig(), 2, BOX, 1_000)


def bandit() -> Agent:
    config = PPOConfig(hidden=[16], learning_rate=0.01, reward_scale=1.0, minibatch_size=100, entropy=0.0)
    return make_agent(config, 2, BOX, 16_000)


def best_action(seen: np.ndarray) -> np.ndarray:
    """Half of what is seen first, and 7 or 3 as it is above 0 or not."""
    return np.column_stack([seen[:, 0] / 2, np.where(seen[:, 0] > 0, 7.0, 3.0)])


def learn(agent: Agent, updates: int, rows: int = 4, steps: int = 100) -> None:
    """A game of one step that pays by how near the action is to the best one."""
    ends = torch.ones(rows * steps, 1, dtype=torch.bool)
    for _ in range(updates):
        data = agent.policy(TensorDict({"observation": torch.rand(rows * steps, 2) * 2 - 1}, [rows * steps]))
        missed = (data["action"].numpy() - best_action(data["observation"].numpy())) / [1, 5]
        after = {"observation": torch.zeros(rows * steps, 2), "done": ends, "terminated": ends.clone()}
        reward = torch.tensor(-np.abs(missed).sum(axis=1), dtype=torch.float32)[:, None]
        after |= {"reward": reward, "success": torch.zeros_like(ends)}
        agent.update(data.set("next", TensorDict(after, rows * steps)).reshape(rows, steps))
        agent.sync_weights()


def missed(agent: Agent) -> float:
    seen = np.random.default_rng(0).uniform(-1, 1, (500, 2)).astype(np.float32)
    actions = agent.greedy(seen)
    assert (actions.shape, actions.dtype) == ((500, 2), np.float32)
    return float((np.abs(actions - best_action(seen)) / [1, 5]).mean())


def test_ppo_learns_the_best_continuous_action_and_grows_sure_of_it():
    agent = bandit()
    assert missed(agent) > 0.25
    learn(agent, 40)
    assert missed(agent) < 0.1
    assert agent.policy.network.log_std.exp().max() < 0.4


def test_the_same_seed_learns_the_same_and_goes_on_from_its_state():
    def weights(agent: Agent) -> torch.Tensor:
        return torch.cat([value.reshape(-1) for value in agent.greedy.state_dict().values()])

    agents = [bandit() for _ in range(2)]
    torch.manual_seed(1)
    learn(agents[0], 4)
    agents[1].load_state_dict(deepcopy(agents[0].state_dict()))
    agents[1].sync_weights()
    for agent in agents:
        torch.manual_seed(2)
        learn(agent, 2)
    assert torch.equal(weights(agents[0]), weights(agents[1]))
    assert agents[0].policy.network.log_std.tolist() != bandit().policy.network.log_std.tolist()


@pytest.mark.parametrize("space", [MultiDiscrete([3, 2], start=[0, 5]), MultiBinary(2)])
def test_several_choices_are_drawn_weighed_and_chosen_together(space: Any):
    made = make_actions(space, 0.5)
    outputs = torch.tensor([[math.log(3), 0.0, 0.0, math.log(3)][: made.outputs]]).repeat(50, 1)
    if made.outputs == 5:
        outputs = torch.cat([outputs, torch.zeros(50, 1)], dim=1)
    drawn = made.draw(outputs)
    assert all(space.contains(row) for row in drawn["action"].numpy())
    log_prob, entropy = made.evaluate_actions(outputs, drawn["action"])
    torch.testing.assert_close(log_prob, drawn["action_log_prob"])
    best_log_prob, _ = made.evaluate_actions(outputs, made.mode(outputs))
    assert (best_log_prob >= log_prob - 1e-6).all()
    assert entropy.shape == (50,)
    network = nn.Linear(2, made.outputs)
    assert made.finish(network) is network


def test_several_choices_by_hand():
    """Chances 3/4 and 1/4, and of the second choice 1/2 each."""
    made = make_actions(MultiBinary(2), 0.5)
    outputs = torch.tensor([[0.0, math.log(3), 0.0, 0.0]])
    log_prob, entropy = made.evaluate_actions(outputs, torch.tensor([[1, 0]]))
    assert log_prob.exp().tolist() == pytest.approx([3 / 8])
    assert entropy.tolist() == pytest.approx([-0.75 * math.log(0.75) - 0.25 * math.log(0.25) + math.log(2)])
    assert made.mode(outputs).tolist() == [[1, 0]]


def test_choices_are_counted_from_their_start():
    made = make_actions(Discrete(2, start=3), 0.5)
    outputs = torch.tensor([[0.0, 9.0]])
    assert made.mode(outputs).tolist() == [4]
    assert made.evaluate_actions(outputs, torch.tensor([4]))[0].item() == pytest.approx(0, abs=1e-3)
    assert set(made.draw(outputs.repeat(9, 1) / 9)["action"].tolist()) <= {3, 4}
