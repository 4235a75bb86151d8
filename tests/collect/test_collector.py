"""Batches come whole and in order, from processes that share neither seeds nor episodes and follow the weights."""

from collections.abc import Iterator
from contextlib import closing
from copy import deepcopy
from dataclasses import fields
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.collectors import Collector

from ibe_rl.agents import Agent, make_agent
from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.collect import collector as collect
from ibe_rl.collect.check import check_collect
from ibe_rl.collect.collector import (
    Batches,
    env_of_worker,
    make_collector,
    steps_of,
)
from ibe_rl.collect.rollout import EVALUATION_SEED
from ibe_rl.config.settings import MAX_SEED, CollectConfig, EnvConfig, InstructorConfig, TrainConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError

pytestmark = pytest.mark.slow

ENV = EnvConfig(id=LANDER_ID)
STEPS = 130


def sizes(processes: int, overlap: bool = False) -> CollectConfig:
    return CollectConfig(processes=processes, envs_per_process=2, steps_per_batch=STEPS, overlap=overlap)


def make_dqn() -> Agent:
    torch.set_num_threads(1)
    torch.manual_seed(0)
    return make_agent(DQNConfig(hidden=[8]), LANDER_TASK.observation_size, make_gym(LANDER_ID, {}).action_space, 1_000)


def always(agent: Any, action: int) -> None:
    """Let the agent learn to choose one action: no weights, one bias, no exploration."""
    for parameter in agent._network.parameters():
        torch.nn.init.zeros_(parameter)
    agent._network[-1].bias.data[action] = 1
    agent._epsilon = 0.0


def gather(processes: int, overlap: bool = False, early: bool = False) -> list[TensorDictBase]:
    """Batches of an agent that learns to fire the main engine while it has the second one: 2 before, 2 after.

    ``early``: each is asked for as soon as the one before was there, and the agent had learnt from it.
    """
    agent = make_dqn()
    collector = make_collector(agent, ENV, sizes(processes, overlap), LANDER_TASK, InstructorConfig(), seed=3)
    try:
        with closing(Batches(collector, agent, overlap)) as source:
            gathered = []
            for number in range(4):
                gathered.append(next(source).clone())
                if number == 1:
                    always(agent, 2)
                if early:
                    source.collect_next()
            return gathered
    finally:
        collector.shutdown()


@pytest.fixture(scope="module")
def one() -> list[TensorDictBase]:
    return gather(1)


@pytest.fixture(scope="module")
def two() -> list[TensorDictBase]:
    return gather(2)


@pytest.fixture(scope="module")
def ahead() -> list[TensorDictBase]:
    return gather(1, overlap=True)


@pytest.fixture(params=["one", "two", "ahead"])
def gathered(request: pytest.FixtureRequest) -> list[TensorDictBase]:
    batches_: list[TensorDictBase] = request.getfixturevalue(request.param)
    return batches_


def test_a_batch_has_a_row_for_each_environment(one: list[TensorDictBase], two: list[TensorDictBase]):
    assert {tuple(batch.shape) for batch in one} == {(2, STEPS)}
    assert {tuple(batch.shape) for batch in two} == {(4, STEPS)}


def test_the_number_of_an_episode_is_its_own(gathered: list[TensorDictBase]):
    whole = torch.cat(gathered, dim=1)
    numbers, done = whole["collector", "traj_ids"], whole["next", "done"].squeeze(-1)
    changes = numbers[:, 1:] != numbers[:, :-1]
    assert torch.equal(changes, done[:, :-1])
    assert changes.any(dim=1).all()
    for row, others in ((row, [i for i in range(len(numbers)) if i != row]) for row in range(len(numbers))):
        assert not torch.isin(numbers[row], numbers[others]).any()


def test_batches_follow_each_other_without_a_gap(gathered: list[TensorDictBase]):
    whole = torch.cat(gathered, dim=1)
    flying = ~whole["next", "done"][:, :-1, 0]
    assert torch.equal(whole["observation"][:, 1:][flying], whole["next", "observation"][:, :-1][flying])


@pytest.mark.parametrize(("kind", "late"), [("one", 0), ("two", 0), ("ahead", 1)])
def test_the_workers_use_the_weights_of_the_trainer(kind: str, late: int, request: pytest.FixtureRequest):
    """At once, or, where the next batch was under way already, one batch later and not in the middle of one."""
    actions = [batch["action"] for batch in request.getfixturevalue(kind)]
    for before in actions[: 2 + late]:
        assert all((before == action).any() for action in range(4))
    for after in actions[2 + late :]:
        assert (after == 2).all()


def test_the_rows_of_a_process_are_the_same_collected_alone(two: list[TensorDictBase]):
    """So the same seed gives the same batches, whichever process is faster."""
    for worker in range(2):
        agent = make_dqn()
        factory = partial(env_of_worker, worker, ENV, sizes(2), LANDER_TASK, InstructorConfig(), 3)
        sizes_: dict[str, Any] = {"frames_per_batch": 2 * STEPS, "total_frames": -1}
        alone = Collector(factory, agent.policy, auto_register_policy_transforms=False, **sizes_)
        for batch, expected in zip(alone, two[:2], strict=False):
            rows = expected[2 * worker : 2 * worker + 2]
            assert (batch.exclude("collector") == rows.exclude("collector")).all()
        alone.shutdown()


def test_the_same_seed_collects_the_same(one: list[TensorDictBase]):
    for batch, expected in zip(gather(1), one, strict=True):
        assert (batch == expected).all()


def test_a_batch_that_is_collected_ahead_is_the_same_batch(one: list[TensorDictBase], ahead: list[TensorDictBase]):
    for batch, expected in zip(ahead[:2], one[:2], strict=True):
        assert (batch.exclude("collector") == expected.exclude("collector")).all()


def test_a_batch_that_is_asked_for_early_is_the_same_batch(two: list[TensorDictBase]):
    for batch, expected in zip(gather(2, early=True), two, strict=True):
        assert (batch.exclude("collector") == expected.exclude("collector")).all()


class Repeats:
    """In a collector's place: its batches say only with which weights they were collected."""

    weights = torch.tensor(-1)

    def update_policy_weights_(self, weights: TensorDictBase) -> None:
        self.weights = weights["learnt"]

    def __iter__(self) -> Iterator[TensorDictBase]:
        while True:
            yield TensorDict({"weights": self.weights.expand(2, 3).clone()}, [2, 3])


class Counts:
    """An agent whose only weight is how often it has learnt."""

    def __init__(self) -> None:
        self.updates, self.policy = 0, torch.nn.Module()
        self.policy.register_buffer("learnt", torch.tensor(0))

    def sync_weights(self) -> None:
        self.policy.learnt.fill_(self.updates)


@pytest.mark.parametrize(
    ("overlap", "ahead_batches", "late"), [(False, 1, 0), (True, 1, 1), (True, 2, 2), (True, 3, 3), (True, 16, 16)]
)
def test_the_weights_are_those_of_so_many_updates_before(overlap: bool, ahead_batches: int, late: int):
    agent: Any = Counts()
    collector: Any = Repeats()
    with closing(Batches(collector, agent, overlap, ahead_batches)) as source:
        for number in range(20):
            batch = next(source)
            assert (batch["weights"] == max(0, number - late)).all()
            agent.updates += 1


@pytest.mark.parametrize("apart", [True, False])
def test_the_next_batch_has_the_weights_of_when_it_was_asked_for(apart: bool):
    """At first of several times; the trainer's own process has other things to do, so there nothing is early."""
    agent: Any = Counts()
    collector: Any = Repeats()
    if apart:
        collector.workers = SimpleNamespace(names=["worker 0"], dead=lambda _: [])
    with closing(Batches(collector, agent, overlap=False)) as source:
        source.collect_next()
        for learnt in (1, 2):
            agent.updates = learnt
            source.collect_next()
        assert (next(source)["weights"] == (0 if apart else 2)).all()
        assert (next(source)["weights"] == 2).all()


def learn_ahead(seed: int) -> tuple[list[TensorDictBase], list[torch.nn.Module]]:
    """Batches, collected three ahead, of an agent that learns from each, and what it was before and after each."""
    torch.manual_seed(0)
    actions = make_gym(LANDER_ID, {}).action_space
    agent: Any = make_agent(PPOConfig(hidden=[8], learning_rate=0.1), LANDER_TASK.observation_size, actions, 10_000)
    collector = make_collector(agent, ENV, sizes(1, overlap=True), LANDER_TASK, InstructorConfig(), seed)
    gathered, networks = [], [deepcopy(agent._actor).requires_grad_(False)]
    try:
        with closing(Batches(collector, agent, overlap=True, ahead_batches=3)) as source:
            for _ in range(7):
                batch = next(source)
                gathered.append(batch.clone())
                agent.update(batch)
                assert (batch == gathered[-1]).all()  # those collected meanwhile have places of their own
                networks.append(deepcopy(agent._actor).requires_grad_(False))
    finally:
        collector.shutdown()
    return gathered, networks


def test_learning_from_batches_ahead_repeats_to_the_last_bit():
    (one, learnt), (other, learnt_again) = learn_ahead(3), learn_ahead(3)
    for batch, expected in zip(one, other, strict=True):
        assert (batch.exclude("collector") == expected.exclude("collector")).all()
    weights, again = (torch.nn.utils.parameters_to_vector(each[-1].parameters()) for each in (learnt, learnt_again))
    assert torch.equal(weights, again)
    for number, batch in enumerate(one):
        said = [network(batch["observation"]).log_softmax(-1) for network in learnt]
        chosen = [each.gather(-1, batch["action"][..., None])[..., 0] for each in said]
        same = [torch.allclose(batch["action_log_prob"], each, atol=1e-6) for each in chosen]
        assert [place for place, found in enumerate(same) if found] == [max(0, number - 3)]


def test_batches_ahead_are_refused_where_none_is_collected_ahead():
    expected = r"^collect\.ahead_batches=3 with collect\.overlap=false: allowed is 1, or collect\.overlap=true"
    with pytest.raises(ConfigError, match=expected):
        check_collect(CollectConfig(ahead_batches=3))
    for config in (CollectConfig(), CollectConfig(overlap=True), CollectConfig(overlap=True, ahead_batches=16)):
        check_collect(config)


def test_the_rows_differ(two: list[TensorDictBase]):
    starts = two[0]["state"][:, 0]
    assert len(starts.unique(dim=0)) == 4


def test_the_log_takes_a_batch(gathered: list[TensorDictBase], tmp_path: Any):
    log = TrajectoryLog(tmp_path, 10_000, LANDER_TASK.contexts)
    for batch in gathered:
        steps = steps_of(batch)
        assert {column.shape[:2] for column in steps.values()} == {tuple(batch.shape)}
        assert steps["state"].shape == steps["next_state"].shape == (*batch.shape, 9)
        assert steps["instruction"].shape == (*batch.shape, 1)
        assert steps["given"].dtype == steps["done"].dtype == steps["success"].dtype == np.bool_
        np.testing.assert_array_equal(steps["reward"], batch["next", "reward"][..., 0])
        np.testing.assert_array_equal(steps["next_state"], batch["next", "state"])
        np.testing.assert_array_equal(steps["success"], batch["next", "success"][..., 0])
        log.add(steps, LANDER_TASK.context)
    whole = torch.cat(gathered, dim=1)
    assert log.frames == whole.numel()
    assert log.episodes_ended == whole["next", "done"].sum() > 2
    for episode in log.read(range(len(log.index))):
        np.testing.assert_array_equal(episode.instructions, LANDER_TASK.rule(episode.states[:-1]))
        assert episode.given.all()


def seeds_of(seed: int, config: CollectConfig, monkeypatch: pytest.MonkeyPatch) -> Iterator[range]:
    """The seeds of each worker's environments, without making them."""
    monkeypatch.setattr(collect, "make_env", lambda _env: None)
    monkeypatch.setattr(collect, "play_briefly", lambda _env, **_seed: None)
    monkeypatch.setattr(collect, "make_vector_env", lambda games, _, first, *_rows: range(first, first + len(games)))
    for worker in range(config.processes):
        seeds: Any = env_of_worker(worker, ENV, config, LANDER_TASK, InstructorConfig(), seed)
        yield seeds


def largest() -> CollectConfig:
    limits = {item.name: item.metadata.get("high") for item in fields(CollectConfig)}
    return CollectConfig(limits["processes"], limits["envs_per_process"], 1)


@pytest.mark.parametrize("seed", [0, 7, MAX_SEED])
def test_no_two_environments_share_a_seed_nor_any_with_an_evaluation(seed: int, monkeypatch: pytest.MonkeyPatch):
    for config in (CollectConfig(), largest()):
        seeds = [number for part in seeds_of(seed, config, monkeypatch) for number in part]
        assert len(set(seeds)) == len(seeds) == config.processes * config.envs_per_process
        assert min(seeds) >= 0
        assert max(seeds) < EVALUATION_SEED


def test_the_largest_seed_is_the_configs_own():
    [limits] = [item.metadata for item in fields(TrainConfig) if item.name == "seed"]
    assert limits["high"] == MAX_SEED


def test_runs_of_different_seeds_share_no_environment(monkeypatch: pytest.MonkeyPatch):
    parts = [set().union(*seeds_of(seed, CollectConfig(), monkeypatch)) for seed in (0, 1, 2)]
    assert len(set().union(*parts)) == sum(map(len, parts))
