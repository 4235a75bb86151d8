"""Agents with a memory and agents with masks: their predicted futures begin with what they know at that moment."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pilots
import pytest
import torch
from bead import BEAD_ID, BEAD_TASK, to_zero
from numpy.testing import assert_allclose, assert_array_equal
from tensordict.nn import TensorDictModule, TensorDictSequential
from torchrl.modules import GRUModule, LSTMModule

from ibe_rl.api.explained import explain_agent, open_run
from ibe_rl.apps.external.adapters import (
    Batched,
    Normalised,
    PredictsMasked,
    PredictsRecurrently,
    ReadsTensorDicts,
    Stacked,
    Statistics,
    reads_masks,
)
from ibe_rl.apps.external.policy import EpsilonGreedy, ExternalPolicy, as_policy
from ibe_rl.apps.external.reading import Reading
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.snapshots import stoppable
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.simulator import Simulator
from ibe_rl.types import ConfigError, observe
from ibe_rl.vocabulary.reactions import ask

FREE: Any = {"masked": False}


def bead(**kwargs: Any) -> Any:
    return make_gym(BEAD_ID, kwargs)


def policy_of(agent: Any, reading: Reading = Reading(False), **kwargs: Any) -> ExternalPolicy:  # noqa: B008 - frozen
    env = bead(**kwargs)
    states = np.array([env.reset(seed=seed)[0] for seed in range(5)])
    examples = observe(states, to_zero(states), np.ones((5, 1)))
    return as_policy(agent, BEAD_TASK, env.action_space, reading, examples, [env] * 5)


def torchrl_agent(memory: Any) -> TensorDictSequential:
    torch.manual_seed(3)
    head = torch.nn.Sequential(torch.nn.Linear(8, 3), pilots.OneHot())
    with torch.no_grad():
        head[0].weight.mul_(20)
    recurrent = memory(input_size=2, hidden_size=8, in_key="observation", out_key="embed")
    with torch.no_grad():
        for weights in recurrent.parameters():
            weights.mul_(3)
    return TensorDictSequential(recurrent, TensorDictModule(head, ["embed"], ["action"]))


def difference(observations: np.ndarray) -> np.ndarray:
    """Three observations of two numbers: goes by how far the bead has come in two steps."""
    return 1 + np.sign(np.round(observations[:, 0] - observations[:, 4], 2)).astype(int)


def statistics(size: int) -> Statistics:
    return Statistics(np.full(size, 0.5), np.full(size, 4.0), 1e-8, 0.25)


def agents() -> dict[str, tuple[Any, Reading]]:
    return {
        "LSTM of TorchRL": (torchrl_agent(LSTMModule), Reading(False)),
        "GRU of TorchRL": (torchrl_agent(GRUModule), Reading(False)),
        "frames": (difference, Reading(False, 3)),
        "normalised frames": (difference, Reading(False, 3, statistics(2))),
    }


def futures_are_true(policy: ExternalPolicy, **kwargs: Any) -> None:
    """From each moment the simulator goes where the episode went; without its memory it does not."""
    instructor = make_instructor(InstructorConfig("oracle"), BEAD_TASK)
    watched = record_rollout(bead(**kwargs), policy, instructor, seed=4)
    simulator = Simulator(lambda: stoppable(bead(**kwargs)), to_zero)
    states, moments = watched.episode.states, watched.moments[:20]
    paths = simulator.rollout(moments, policy, 10).paths
    assert_allclose(paths, [states[start : start + 11] for start in range(20)], atol=1e-5)
    if moments[-1].memory is not None:
        without = simulator.rollout([replace(one, memory=None) for one in moments], policy, 10).paths
        assert np.abs(without - paths).max() > 0.01
    assert moments[0].memory is None


@pytest.mark.parametrize("name", agents())
def test_a_future_begins_with_the_memory_of_its_moment(name: str) -> None:
    agent, reading = agents()[name]
    futures_are_true(policy_of(agent, reading, **FREE), **FREE)


def contrib(kind: str, *args: Any, **kwargs: Any) -> Any:
    library = import_module("sb3_contrib")
    return getattr(library, kind)(*args, bead(masked=kind == "MaskablePPO"), seed=0, device="cpu", **kwargs)


def test_a_recurrent_agent_of_sb3_contrib_is_asked_as_it_is_there() -> None:
    small = {"lstm_hidden_size": 8, "net_arch": [8]}
    model = contrib("RecurrentPPO", "MlpLstmPolicy", n_steps=128, learning_rate=0.03, policy_kwargs=small).learn(1024)
    policy = policy_of(model, Reading(), **FREE)
    assert policy.agent == PredictsRecurrently(model.policy)
    futures_are_true(policy, **FREE)
    random = np.random.default_rng(0)
    memories: Any = [None, None]
    state, begins = None, np.ones(2, bool)
    for _ in range(5):
        observations = random.normal(size=(2, 2)).astype(np.float32)
        expected, state = model.predict(observations, state, begins, deterministic=True)
        actions, memories = policy.agent(observations, memories, None)
        assert_array_equal(actions, expected)
        begins = np.zeros(2, bool)
    alone = policy.agent(observations[:1], memories[:1], None)[1]
    both = policy.agent(observations, [memories[0], None], None)[1]
    assert_allclose(alone[0], both[0], atol=1e-6)
    assert_allclose(both[1], policy.agent(observations[1:], [None], None)[1][0], atol=1e-6)


def test_masks_are_asked_of_the_environment_and_of_its_copies() -> None:
    model = contrib("MaskablePPO", "MlpPolicy", n_steps=64).learn(64)
    policy = policy_of(model, Reading())
    assert policy.agent == PredictsMasked(model.policy)
    assert reads_masks(Normalised(Stacked(policy.agent, 2), statistics(2)))
    assert not reads_masks(Batched(difference))
    futures_are_true(policy)  # the bead asserts that no action is masked
    wandering = EpsilonGreedy(policy, 0.7, bead().action_space, seed=0)
    watched = record_rollout(bead(), wandering, make_instructor(InstructorConfig("oracle"), BEAD_TASK), seed=1)
    assert set(watched.episode.actions.tolist()) == {0, 1, 2}
    assert ask(watched.moments, policy, Simulator(lambda: stoppable(bead()), to_zero), 5) is not None
    with pytest.raises(ConfigError, match=r"trained with masks, and Bead has no method action_masks\(\); allowed is"):
        policy_of(model, Reading(), **FREE)


def test_frames_begin_with_zeros_and_the_newest_is_last() -> None:
    seen: list[np.ndarray] = []
    agent = Stacked(Batched(lambda observations: seen.append(observations)), 3)
    memories: Any = [None, None]
    for step in (1.0, 2.0, 3.0, 4.0):
        _, memories = agent(np.array([[step, -step], [10 * step, 0]]), memories, None)
    assert_array_equal(seen[0], [[0, 0, 0, 0, 1, -1], [0, 0, 0, 0, 10, 0]])
    assert_array_equal(seen[1][0], [0, 0, 1, -1, 2, -2])
    assert_array_equal(seen[3], [[2, -2, 3, -3, 4, -4], [20, 0, 30, 0, 40, 0]])
    agent(np.array([[7.0, 7.0]]), [memories[1]], None)
    assert_array_equal(seen[4], [[30, 0, 40, 0, 7, 7]])


def test_statistics_are_those_of_one_observation_or_of_all_frames() -> None:
    assert_allclose(statistics(2)(np.array([[0.5, 0.9], [0.5, -9]])), [[0, 0.2], [0, -0.25]])
    inside = policy_of(difference, Reading(False, 3, statistics(2)), **FREE).agent
    outside = policy_of(difference, Reading(False, 3, statistics(6)), **FREE).agent
    assert isinstance(inside, Normalised)
    assert isinstance(outside, Stacked)
    with pytest.raises(ConfigError, match=r"statistics are of observations of shape \(5,\); allowed is \(2,\)"):
        policy_of(difference, Reading(False, 3, statistics(5)), **FREE)


def test_what_a_module_reads_and_writes_is_named() -> None:
    ReadsTensorDicts.of(torchrl_agent(LSTMModule), 0)
    for reads, writes in ((["pixels"], ["action"]), (["observation"], ["logits"])):
        module = TensorDictModule(torch.nn.Linear(2, 3), reads, writes)
        with pytest.raises(
            ConfigError, match=f"agent: it reads {reads[0]} and writes {writes[0]}; allowed is to read obs"
        ):
            policy_of(module, **FREE)


def test_a_state_that_nobody_knows_is_refused() -> None:
    class Odd:
        observation_space, action_space = bead().observation_space, bead().action_space

        def predict(self, observations: np.ndarray, deterministic: bool) -> Any:
            return np.zeros(len(observations), int), {"hidden": 1}

    with pytest.raises(
        ConfigError, match=r"its predict\(\) returns a state, dict; allowed are a model without a memory"
    ):
        policy_of(Odd(), Reading(), **FREE)


def test_masks_that_nobody_could_ask_or_that_the_agent_ignores_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: Any = {"env": bead, "episodes": 4, "run_dir": tmp_path / "run", "settings": ["viewer=off"]}
    model = contrib("MaskablePPO", "MlpPolicy", n_steps=64)
    with pytest.raises(
        ConfigError, match=r"predictor=ensemble with an agent that reads masks: .* allowed is predictor=sim"
    ):
        explain_agent(model, **asked | {"settings": ["predictor=ensemble", "viewer=off"]})
    assert not (tmp_path / "run").exists()
    quick = ["mapping.horizon_steps=5", "mapping.spans_steps=[3]", "mapping.top_fraction=1", "viewer=off"]
    to_the_other_side = {"episodes": 12, "run_dir": tmp_path / "made", "settings": quick, "random_actions": 0.5}
    made = explain_agent(model, **asked | to_the_other_side).run.folder
    with pytest.raises(ConfigError, match=r"predictor=ensemble with an agent that reads masks"):
        open_run(made, model, ["predictor=ensemble"], env=bead)
    with pytest.raises(ConfigError, match="episodes=4: no vocabulary"):
        explain_agent(lambda states: np.ones(len(states), int), agent_sees_instruction=False, **asked)
    assert "which actions are allowed (action_masks); this agent does not read it" in capsys.readouterr().out
