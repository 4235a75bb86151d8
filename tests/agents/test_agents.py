"""Every agent learns, repeats itself from the same seed, leaves its batch alone and can be saved."""

import io
from copy import deepcopy
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torch import nn

from ibe_rl.agents import Agent, check_agent, make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.agents.reward import learning_reward
from ibe_rl.config.settings import AgentConfig
from ibe_rl.types import ConfigError

TOTAL = 8_000
CONFIGS: dict[str, AgentConfig] = {
    "ppo": PPOConfig(hidden=[16], learning_rate=0.01, reward_scale=1.0, epochs=4, minibatch_size=100),
    "dqn": DQNConfig(
        hidden=[16],
        learning_rate=0.01,
        reward_scale=1.0,
        minibatch_size=64,
        frames_per_update=20,
        learn_after_frames=800,
        target_rate=0.1,
    ),
}
EVERY = pytest.mark.parametrize("kind", CONFIGS)


@pytest.fixture(autouse=True)
def one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)


def make(kind: str, **changes: Any) -> Agent:
    return make_agent(replace(CONFIGS[kind], **changes), 2, gymnasium.spaces.Discrete(3), TOTAL)


def batch(agent: Agent, rows: int = 4, steps: int = 100) -> TensorDict:
    """A game of one step: action 2 is right where the first number is above 0, else action 0."""
    size = (rows, steps)
    data = TensorDict({"observation": torch.rand(*size, 2) * 2 - 1}, size)
    flat = agent.policy(data.reshape(-1))
    right = 2 * (flat["observation"][:, 0] > 0)
    ends = torch.ones(rows * steps, 1, dtype=torch.bool)
    after = {"observation": torch.zeros(rows * steps, 2), "done": ends, "terminated": ends.clone()}
    reward = (flat["action"] == right).float()[:, None]
    after |= {"reward": reward, "success": torch.zeros_like(ends)}
    return flat.set("next", TensorDict(after, rows * steps)).reshape(size)


def learn(agent: Agent, updates: int) -> dict[str, float]:
    for _ in range(updates):
        figures = agent.update(batch(agent))
        agent.sync_weights()
    return figures


def share_right(agent: Agent) -> float:
    seen = np.random.default_rng(0).uniform(-1, 1, (500, 2)).astype(np.float32)
    return float(np.mean(agent.greedy(seen) == 2 * (seen[:, 0] > 0)))


@EVERY
def test_it_learns_what_is_rewarded(kind: str):
    agent = make(kind)
    assert share_right(agent) < 0.9
    learn(agent, 20)
    assert share_right(agent) > 0.97


@EVERY
def test_the_exploring_policy_learns_too(kind: str):
    agent = make(kind)
    before = batch(agent)["next", "reward"].mean()
    learn(agent, 20)
    assert before < 0.6
    assert batch(agent)["next", "reward"].mean() > 0.8


@EVERY
def test_the_exploring_policy_stands_still_until_synced(kind: str):
    """A worker may be collecting with it while the learner learns."""
    agent, seen = make(kind), torch.rand(50, 2)
    before = agent.policy.network(seen)
    agent.update(batch(agent, steps=300))
    assert torch.equal(agent.policy.network(seen), before)
    agent.sync_weights()
    assert not torch.equal(agent.policy.network(seen), before)


@EVERY
def test_the_same_seed_learns_the_same(kind: str):
    def weights(seed: int) -> torch.Tensor:
        torch.manual_seed(seed)
        agent = make(kind)
        learn(agent, 4)
        return torch.cat([value.reshape(-1) for value in agent.greedy.state_dict().values()])

    assert torch.equal(weights(1), weights(1))
    assert not torch.equal(weights(1), weights(2))


@EVERY
def test_the_batch_is_left_as_it_was_for_the_log(kind: str):
    agent = make(kind, reward_scale=0.05)
    steps = batch(agent)
    before = steps.clone()
    agent.update(steps)
    assert set(steps.keys(True, True)) == set(before.keys(True, True))
    assert (steps == before).all()


@EVERY
def test_the_figures_have_the_same_names_every_time(kind: str):
    agent = make(kind)
    first, later = learn(agent, 1), learn(agent, 3)
    assert first.keys() == later.keys()
    assert all(isinstance(value, float) and np.isfinite(value) for value in (first | later).values())


@EVERY
def test_the_policies_keep_their_shapes(kind: str):
    agent = make(kind)
    chosen = agent.policy(TensorDict({"observation": torch.rand(5, 2)}, [5]))
    assert set(chosen.keys()) == {"observation", *agent.policy.out_keys}
    assert chosen["action"].shape == (5,)
    assert chosen["action"].dtype == torch.int64
    actions = agent.greedy(np.zeros((5, 2), np.float32))
    assert (actions.shape, actions.dtype) == ((5,), np.int64)


@EVERY
def test_the_state_loads_without_running_code(kind: str):
    agent, other, file = make(kind), make(kind), io.BytesIO()
    learn(agent, 4)
    torch.save(agent.state_dict(), file)
    file.seek(0)
    loaded = torch.load(file, weights_only=True)
    assert loaded["frames"] == 1600
    other.greedy.load_state_dict(loaded["greedy"])
    seen = np.random.default_rng(0).uniform(-1, 1, (100, 2)).astype(np.float32)
    np.testing.assert_array_equal(other.greedy(seen), agent.greedy(seen))


def as_once_saved(state: dict[str, Any]) -> dict[str, Any]:
    """The state as earlier versions saved it: that of the optimizer had an entry for each parameter."""
    networks = [state[name] for name in ("actor", "critic", "network") if name in state]
    shapes = [one.shape for network in networks for name, one in network.items() if name.endswith(("weight", "bias"))]
    flat = state["optimizer"]["state"][0]
    parts = zip(*(flat[name].split([one.numel() for one in shapes]) for name in ("exp_avg", "exp_avg_sq")), strict=True)
    each = {
        number: {"step": flat["step"], "exp_avg": mean.view(shape), "exp_avg_sq": square.view(shape)}
        for number, (shape, (mean, square)) in enumerate(zip(shapes, parts, strict=True))
    }
    groups = [state["optimizer"]["param_groups"][0] | {"params": [*each]}]
    return state | {"optimizer": {"state": each, "param_groups": groups}}


@EVERY
def test_it_goes_on_from_the_state_of_an_earlier_version(kind: str):
    agent, other = make(kind), make(kind)
    learn(agent, 4)
    state = as_once_saved(deepcopy(agent.state_dict()))
    assert len(state["optimizer"]["state"]) == {"ppo": 8, "dqn": 4}[kind]  # weights and biases of two layers
    other.load_state_dict(state)
    other.sync_weights()
    losses = []
    for one in (agent, other):
        torch.manual_seed(1)
        losses.append(learn(one, 2))
    assert losses[0] == losses[1]
    for name, weights in agent.greedy.state_dict().items():
        assert torch.equal(weights, other.greedy.state_dict()[name])


def test_ppo_falls_silent_towards_the_end():
    """The learning rate goes to 0 in a straight line."""
    agent, rates = make("ppo", epochs=1), []
    for _ in range(22):
        learn(agent, 1)
        rates.append(agent.state_dict()["optimizer"]["param_groups"][0]["lr"])
    np.testing.assert_allclose(rates, 0.01 * np.clip(1 - np.arange(22) * 400 / TOTAL, 0, 1))


def test_ppos_entropy_bonus_keeps_it_curious():
    def entropy(weight: float) -> float:
        torch.manual_seed(0)
        return learn(make("ppo", entropy=weight), 6)["entropy"]

    assert entropy(1.0) > entropy(0.0) + 0.3


def test_dqn_explores_less_and_less():
    """From 1 to 0.4 in half of the run, from there to 0.1 at its end."""
    agent = make("dqn", epsilon_share=0.5, epsilon_early=0.4, epsilon_end=0.1)
    shown = [learn(agent, 1)["epsilon"] for _ in range(22)]
    expected = np.interp(np.arange(22) * 400, [0, TOTAL / 2, TOTAL], [1.0, 0.4, 0.1])
    np.testing.assert_allclose(shown, expected, atol=1e-6)
    assert float(agent.policy.epsilon) == pytest.approx(0.1)


def test_dqn_learns_less_and_less():
    agent = make("dqn", frames_per_update=400, learn_after_frames=0)
    rates = []
    for _ in range(22):
        learn(agent, 1)
        rates.append(agent.state_dict()["optimizer"]["param_groups"][0]["lr"])
    np.testing.assert_allclose(rates, 0.01 * np.clip(1 - np.arange(22) * 400 / TOTAL, 0, 1))


def test_dqn_waits_then_learns_at_its_own_rate():
    agent = make("dqn", learn_after_frames=800, frames_per_update=50)
    steps = []
    for _ in range(4):
        learn(agent, 1)
        state = agent.state_dict()["optimizer"]["state"]
        steps.append(int(state[0]["step"]) if state else 0)
    assert steps == [0, 8, 16, 24]


def test_dqn_explores_as_often_as_epsilon_says():
    agent = make("dqn")
    data = TensorDict({"observation": torch.rand(1, 2).expand(6000, 2)}, [6000])
    for epsilon in (1.0, 0.3, 0.0):
        agent.policy.epsilon.fill_(epsilon)
        best = agent.policy.network(data["observation"]).argmax(-1)
        wrong = (agent.policy(data)["action"] != best).float().mean().item()
        assert wrong == pytest.approx(epsilon * 2 / 3, abs=0.03)


def test_ppo_draws_with_the_probabilities_it_notes():
    agent = make("ppo")
    nn.init.normal_(agent.policy.network[-1].bias)
    drawn = agent.policy(TensorDict({"observation": torch.full((6000, 2), 0.5)}, [6000]))
    for action in range(3):
        rows = drawn["action"] == action
        noted = drawn["action_log_prob"][rows].exp()
        assert torch.allclose(noted, noted[0])
        assert rows.float().mean().item() == pytest.approx(noted[0].item(), abs=0.03)


def test_a_success_is_worth_a_bonus():
    after = {"reward": torch.tensor([[1.0], [-3.0], [2.0]]), "success": torch.tensor([[False], [True], [True]])}
    data = TensorDict({"next": TensorDict(after, [3])}, [3])
    learnt = learning_reward(data, AgentConfig(success_bonus=10.0, reward_scale=0.5))
    assert learnt[:, 0].tolist() == [0.5, 3.5, 6.0]
    assert data["next", "reward"][:, 0].tolist() == [1, -3, 2]


@EVERY
def test_it_learns_what_is_a_success(kind: str):
    agent = make(kind, success_bonus=1.0)
    for _ in range(20):
        steps = batch(agent)
        steps["next", "success"] = steps["next", "reward"] > 0
        steps["next", "reward"].zero_()
        agent.update(steps)
        agent.sync_weights()
    assert share_right(agent) > 0.97


def test_an_unknown_agent_is_refused():
    with pytest.raises(
        ConfigError, match=r"agent\.kind=sac: no such kind; allowed is module:Class, or a file in configs/agent"
    ):
        make_agent(AgentConfig(kind="sac"), 2, gymnasium.spaces.Discrete(3), TOTAL)


@pytest.mark.parametrize("widths", [[0], [-3], [64, 10**9]])
def test_layers_without_a_width_are_refused(widths: list[int]) -> None:
    with pytest.raises(ConfigError, match=r"agent\.hidden=.*: allowed are widths of 1 to 100000"):
        check_agent(PPOConfig(hidden=widths), ["x"])


def test_half_of_a_mirrored_layer_is_a_whole_number_of_units() -> None:
    with pytest.raises(ConfigError, match=r"agent\.hidden=\[8, 7\]: with agent\.mirror=true allowed are even widths"):
        check_agent(PPOConfig(hidden=[8, 7], mirror=True), ["x"])
