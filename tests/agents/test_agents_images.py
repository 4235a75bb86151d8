"""Agents that read images and standardise: they learn, keep all they continue from, and explain what they learnt."""

from io import BytesIO
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from tensordict import TensorDict

from ibe_rl.agents import check_agent, make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import AgentConfig
from ibe_rl.task import FLAGS, IMAGE, NUMBERS, Part
from ibe_rl.types import ConfigError

PARTS = [Part("picture", IMAGE, (6, 8, 3)), Part("speed", NUMBERS, (1,)), Part("way", FLAGS, (2,))]
SIZE, STEPS = 144 + 1 + 2 + 2, 40
WANTED: dict[str, Any] = {"hidden": [8], "standardise_observations": True, "standardise_rewards": True}
CONFIGS = {
    "ppo": PPOConfig(minibatch_size=64, epochs=1, **WANTED),
    "dqn": DQNConfig(
        learn_after_frames=100, minibatch_size=16, frames_per_update=40, buffer_frames=1_000, n_steps=3, **WANTED
    ),
}


def make(name: str, seed: int = 0, parts: list[Part] = PARTS) -> Any:
    torch.manual_seed(seed)
    return make_agent(CONFIGS[name], SIZE, gymnasium.spaces.Discrete(3), 3_000, ("x", "v"), parts)


def batch(agent: Any, seed: int) -> TensorDict:
    """Steps of 4 environments; the action 1 is paid for in a bright picture, 0 in a dark one."""
    random = torch.Generator().manual_seed(seed)
    seen = torch.zeros(4, STEPS + 1, SIZE)
    bright = torch.randint(0, 2, (4, STEPS + 1, 1), generator=random)
    seen[..., :144] = 200 * bright + torch.randint(0, 50, (4, STEPS + 1, 144), generator=random)
    seen[..., 144] = 1_000 * torch.randn(4, STEPS + 1, generator=random)
    seen[..., 145] = 1
    torch.manual_seed(seed)
    steps = agent.policy(TensorDict({"observation": seen[:, :-1].flatten(0, 1)}, [4 * STEPS])).reshape(4, STEPS)
    none = torch.zeros(4, STEPS, 1, dtype=torch.bool)
    reward = 500.0 * (steps["action"].unsqueeze(-1) == bright[:, :-1])
    after = {"observation": seen[:, 1:], "reward": reward, "done": ~none, "terminated": ~none, "success": none}
    return steps.set("next", TensorDict(after, [4, STEPS]))


def taught(name: str, batches: int) -> Any:
    agent = make(name)
    for seed in range(batches):
        agent.update(batch(agent, seed))
        agent.sync_weights()
    return agent


@pytest.mark.parametrize("name", CONFIGS)
def test_it_learns_from_the_picture(name: str):
    agent = taught(name, 18)
    assert agent.standardised == ["observations", "rewards"]
    seen = batch(agent, 99)["observation"].flatten(0, 1).numpy()
    bright = seen[:, :144].mean(axis=1) > 100
    assert np.mean(agent.greedy(seen) == bright) > 0.9


@pytest.mark.parametrize("name", CONFIGS)
def test_it_goes_on_from_its_state_and_greedy_carries_the_standardiser(name: str):
    one, other, file = taught(name, 4), make(name, seed=5), BytesIO()
    torch.save(one.state_dict(), file)
    file.seek(0)
    other.load_state_dict(torch.load(file, weights_only=True))
    other.sync_weights()
    for agent in (one, other):
        torch.manual_seed(1)
        agent.losses = agent.update(batch(agent, 50))
    assert one.losses == other.losses
    seen = batch(one, 7)["observation"].flatten(0, 1).numpy()
    np.testing.assert_array_equal(one.greedy(seen), other.greedy(seen))
    alone = make(name, seed=6)
    alone.greedy.load_state_dict(one.greedy.state_dict())
    np.testing.assert_array_equal(alone.greedy(seen), one.greedy(seen))


def test_the_first_batch_only_measures_where_ppo_standardises():
    agent = make("ppo")
    assert all(np.isnan(loss) for loss in agent.update(batch(agent, 0)).values())
    agent.sync_weights()
    assert not any(np.isnan(loss) for loss in agent.update(batch(agent, 1)).values())


def test_what_an_agent_cannot_read_is_refused(monkeypatch: pytest.MonkeyPatch):
    class Plain:
        def __init__(self, config: Any, observation_size: int, actions: Any, total_frames: int, ignored: Any):
            """Takes no parts."""

    with pytest.raises(ConfigError, match=r"agent\.ignores=\['x'\] with env\.task\.state: allowed is \[\]"):
        check_agent(PPOConfig(ignores=["x"]), ["x", "v"], PARTS)
    monkeypatch.setattr("ibe_rl.agents.implementation", lambda *_: Plain)
    check_agent(AgentConfig("plain"), ["x", "v"], PARTS[1:])
    with pytest.raises(ConfigError, match=r"agent=plain: its constructor takes no parts.* observations without images"):
        check_agent(AgentConfig("plain"), ["x", "v"], PARTS)
