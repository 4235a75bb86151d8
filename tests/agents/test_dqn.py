"""Returns of several steps, across ends and the edges of batches, and what the network is taught, by hand."""

from copy import deepcopy

import pytest
import torch
from gymnasium.spaces import Discrete
from tensordict import TensorDict
from torch import nn
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss

from ibe_rl.agents.dqn import DQN, DQNConfig, n_step_returns


def steps_of(rewards: list[float], done: str, terminated: str) -> TensorDict:
    """One row; the observation is the number of the step, the next one half a step on; "x" marks an end."""
    count = len(rewards)
    numbers = torch.arange(float(count)).reshape(1, count, 1)
    after = {
        "observation": numbers + 0.5,
        "reward": torch.tensor(rewards).reshape(1, count, 1),
        "success": torch.zeros(1, count, 1, dtype=torch.bool),
        "done": torch.tensor([mark == "x" for mark in done]).reshape(1, count, 1),
        "terminated": torch.tensor([mark == "x" for mark in terminated]).reshape(1, count, 1),
    }
    inside = {"observation": numbers, "action": torch.arange(count).reshape(1, count) % 2}
    return TensorDict(inside | {"next": TensorDict(after, [1, count])}, [1, count])


def test_one_step_is_what_was_rewarded_at_once():
    data = n_step_returns(steps_of([1, 2, 3], "-x-", "-x-"), 1, 0.5)
    assert data["reward"].tolist() == [1, 2, 3]
    assert data["later"].flatten().tolist() == [0.5, 1.5, 2.5]
    assert data["discount"].tolist() == [0.5, 0, 0.5]


@pytest.mark.parametrize(
    ("terminated", "discounts"), [("--x---", [0, 0, 0, 0.125]), ("------", [0.125, 0.25, 0.5, 0.125])]
)
def test_three_steps_stop_at_an_end(terminated: str, discounts: list[float]):
    """After a game that has ended comes nothing; one that was cut off would have gone on from its last state."""
    data = n_step_returns(steps_of([1, 2, 4, 8, 16, 32], "--x---", terminated), 3, 0.5)
    assert data["observation"].flatten().tolist() == [0, 1, 2, 3]
    assert data["action"].tolist() == [0, 1, 0, 1]
    assert data["reward"].tolist() == [1 + 1 + 1, 2 + 2, 4, 8 + 8 + 8]
    assert data["later"].flatten().tolist() == [2.5, 2.5, 2.5, 5.5]
    assert data["discount"].tolist() == discounts


def test_rows_are_apart():
    both = torch.cat([steps_of([1, 2, 4], "-x-", "-x-"), steps_of([3, 5, 7], "---", "---")])
    data = n_step_returns(both, 2, 1.0)
    assert data["reward"].tolist() == [3, 2, 8, 12]
    assert data["discount"].tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("lengths", [[12], [4, 4, 4], [1] * 12, [2, 7, 3]])
def test_the_edges_of_batches_do_not_show(lengths: list[int]):
    torch.manual_seed(0)
    steps = steps_of(torch.rand(12).tolist(), "----x---x---", "----x-------")
    agent = DQN(
        DQNConfig(n_steps=3, gamma=0.5, reward_scale=2.0, hidden=[4], buffer_frames=1_000), 1, Discrete(2), 1_000
    )
    for part in steps.split(lengths, 1):
        agent.update(part)
    expected = n_step_returns(steps, 3, 0.5)
    expected["reward"] *= 2.0
    stored = agent._buffer[:]
    assert len(stored) == 10
    for key in ("observation", "action", "reward", "later", "discount"):
        torch.testing.assert_close(stored[key], expected[key])


def test_the_network_chooses_and_the_target_values():
    """Double Q-learning: the target network's highest value, 9, is not what counts."""
    agent = DQN(DQNConfig(hidden=[4]), 1, Discrete(2), 1_000)
    for network, values in ((agent._network, [1.0, 2.0]), (agent._target.module, [9.0, 5.0])):
        nn.init.zeros_(network[-1].weight)
        network[-1].bias.data = torch.tensor(values)
    data = {"later": torch.zeros(2, 1), "reward": torch.tensor([1.0, 1.0]), "discount": torch.tensor([0.5, 0.0])}
    assert agent._worth(TensorDict(data, [2])).tolist() == [3.5, 1]


def test_the_target_follows_once_a_batch():
    torch.manual_seed(0)
    config = DQNConfig(
        n_steps=1, hidden=[4], learn_after_frames=0, frames_per_update=1, target_rate=0.25, minibatch_size=8
    )
    agent = DQN(config, 1, Discrete(2), 1_000)
    steps = steps_of([1.0] * 8, "--------", "--------")
    agent.update(steps)
    before = agent._target.module[-1].bias.clone()
    agent.update(steps)
    expected = before + 0.25 * (agent._network[-1].bias - before)
    torch.testing.assert_close(agent._target.module[-1].bias, expected)
    assert not torch.equal(before, agent._network[-1].bias)


@pytest.mark.filterwarnings("ignore:No target network updater")  # the loss is only compared with, never trained
def test_with_one_step_loss_and_gradients_are_torchrls():
    torch.manual_seed(2)
    agent = DQN(DQNConfig(n_steps=1, gamma=0.9, hidden=[8]), 1, Discrete(3), 1_000)
    steps = steps_of(torch.rand(12).tolist(), "---x-------x", "---x--------")
    steps["observation"], steps["next", "observation"] = torch.randn(1, 12, 1), torch.randn(1, 12, 1)
    steps["action"] = torch.randint(3, (1, 12))
    learnt_weights = deepcopy(agent._network.state_dict())
    for parameter in agent._network.parameters():
        nn.init.normal_(parameter)
    agent._target.module.load_state_dict(agent._network.state_dict())
    theirs = DQNLoss(
        QValueActor(agent._network, in_keys=["observation"], action_space="categorical"),
        loss_function="smooth_l1",
        delay_value=True,
        double_dqn=True,
        action_space="categorical",
    )  # its target network is a copy of the network as it is now
    theirs.make_value_estimator(gamma=0.9)
    agent._network.load_state_dict(learnt_weights)
    expected = theirs(steps.reshape(-1))["loss"]
    expected.backward()
    gradients = [parameter.grad.clone() for parameter in agent._network.parameters()]

    data = n_step_returns(steps, 1, 0.9)
    ours = agent._step(data["observation"], data["action"], agent._worth(data))
    torch.testing.assert_close(ours, expected)
    torch.testing.assert_close(agent._optimizer.flat.grad, torch.cat([one.flatten() for one in gradients]))


def test_actions_are_counted_from_their_start():
    torch.manual_seed(0)
    agent = DQN(DQNConfig(hidden=[4], learn_after_frames=0, n_steps=1), 1, Discrete(2, start=5), 100)
    rows = TensorDict({"observation": torch.zeros(40, 1)}, [40])
    assert set(agent.policy(rows)["action"].tolist()) == {5, 6}
    steps = steps_of([1.0] * 20, "-" * 20, "-" * 20)
    steps["action"] += 5
    agent.update(steps)
    assert set(agent.greedy(steps["observation"][0].numpy()).tolist()) <= {5, 6}
