"""An agent that ignores a part of the state does not see it, and sees all the rest."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium.spaces import Discrete
from tensordict import TensorDict

from ibe_rl.agents import Agent, check_agent, make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.networks import InputMask
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.config.settings import AgentConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.storage.checkpoint import load, save_policy
from ibe_rl.types import Array, ConfigError

CONFIGS: dict[str, AgentConfig] = {"ppo": PPOConfig(hidden=[32]), "dqn": DQNConfig(hidden=[32], learn_after_frames=0)}
EVERY = pytest.mark.parametrize("kind", CONFIGS)
NAMES, SIZE = LANDER_TASK.state_names, LANDER_TASK.observation_size


def make(kind: str, *ignores: str, seed: int = 0) -> Agent:
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    agent = make_agent(replace(CONFIGS[kind], ignores=list(ignores)), SIZE, Discrete(4), 10_000, NAMES)
    for network in (agent.policy.network, agent.greedy._average.module):
        torch.nn.init.normal_(list(network.parameters())[-2])  # the last layer begins almost at 0
    return agent


def observations(count: int = 200) -> Array:
    return np.random.default_rng(0).normal(size=(count, SIZE)).astype(np.float32)


def outputs(agent: Agent, seen: Array) -> dict[str, Array]:
    """What each network says, and what the exploring policy does with the same draws."""
    data = torch.from_numpy(seen)
    torch.manual_seed(1)
    with torch.no_grad():
        said = {"exploring": agent.policy.network(data), "greedy": agent.greedy._average.module(data)}
    chosen = agent.policy(TensorDict({"observation": data}, [len(seen)]))
    said |= {name: chosen[name] for name in agent.policy.out_keys}
    return {name: value.numpy() for name, value in said.items()} | {"chosen": agent.greedy(seen)}


@EVERY
@pytest.mark.parametrize("ignored", [("goal_x",), ("x",), ("vx", "goal_x")])
def test_what_is_ignored_changes_nothing_and_all_else_does(kind: str, ignored: tuple[str, ...]):
    agent, seen = make(kind, *ignored), observations()
    before = outputs(agent, seen)
    hidden = seen.copy()
    for name in ignored:
        hidden[:, NAMES.index(name)] = np.nan
    for name, said in outputs(agent, hidden).items():
        np.testing.assert_array_equal(said, before[name], err_msg=name)
    for place in set(range(SIZE)) - {NAMES.index(name) for name in ignored}:
        other = seen.copy()
        other[:, place] += 1
        after = outputs(agent, other)
        for name in ("exploring", "greedy"):
            assert (after[name] != before[name]).any(axis=1).all(), f"{name}: place {place}"


@EVERY
def test_who_ignores_nothing_sees_everything(kind: str):
    agent, seen = make(kind), observations()
    other = seen.copy()
    other[:, NAMES.index("goal_x")] += 1
    for name in ("exploring", "greedy"):
        assert (outputs(agent, seen)[name] != outputs(agent, other)[name]).any(axis=1).all()


def batch(agent: Agent) -> TensorDict:
    """A game of one step, paid by a number that is ignored."""
    seen = torch.from_numpy(observations(512))
    torch.manual_seed(3)
    data = agent.policy(TensorDict({"observation": seen}, [512]))
    ends = torch.ones(512, 1, dtype=torch.bool)
    after = {"observation": seen.clone(), "reward": seen[:, 8:9].clone(), "success": ~ends}
    data["next"] = TensorDict(after | {"done": ends, "terminated": ends.clone()}, [512])
    return data.reshape(8, 64)


@EVERY
def test_it_stays_blind_while_it_learns(kind: str):
    """The critic of PPO too, and the target network of DQN: nothing that it learns depends on the goal."""
    agents = [make(kind, "goal_x") for _ in range(2)]
    for agent, goal in zip(agents, (0.0, 5.0), strict=True):
        steps = batch(agent)
        for seen in (steps["observation"], steps["next", "observation"]):
            seen[..., 8] = goal
        for _ in range(3):
            torch.manual_seed(2)
            agent.update(steps)
        agent.sync_weights()
    one, other = (outputs(agent, observations()) for agent in agents)
    for name, said in one.items():
        np.testing.assert_array_equal(said, other[name], err_msg=name)


@EVERY
def test_learning_is_not_lost_on_it(kind: str):
    agent = make(kind, "goal_x")
    before = outputs(agent, observations())["greedy"]
    agent.update(batch(agent))
    assert (outputs(agent, observations())["greedy"] != before).any()


@EVERY
def test_a_checkpoint_loads_again(kind: str, tmp_path: Path):
    agent, other = make(kind, "goal_x"), make(kind, "goal_x", seed=1)
    agent.update(batch(agent))
    path = save_policy(tmp_path, 512, agent.greedy.state_dict())
    other.greedy.load_state_dict(load(path))
    np.testing.assert_array_equal(other.greedy(observations()), agent.greedy(observations()))
    assert (make(kind, "goal_x", seed=1).greedy(observations()) != agent.greedy(observations())).any()


@EVERY
def test_what_is_not_there_cannot_be_ignored(kind: str):
    for name in ("goal", "instruction", ""):
        with pytest.raises(ConfigError, match=rf"^agent\.ignores={name}: allowed are {', '.join(NAMES)}$"):
            make(kind, name)
        with pytest.raises(ConfigError, match=rf"^agent\.ignores={name}: allowed are "):
            check_agent(replace(CONFIGS[kind], ignores=["x", name]), NAMES)
    check_agent(replace(CONFIGS[kind], ignores=["x", "goal_x", "x"]), NAMES)


def test_a_blind_network_leaves_what_it_sees_alone():
    blind = InputMask(3, [1])
    assert blind(torch.tensor([[1.0, 2.0, -3.0], [0.0, torch.inf, 5.0]])).tolist() == [[1, 0, -3], [0, 0, 5]]
    assert InputMask(2, [1, 1, 0])(torch.ones(4, 5, 2)).sum() == 0
