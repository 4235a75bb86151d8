"""Real flights of the demo's policy: which moments are taken, what followed, and what was predicted."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ibe_rl.agents import make_agent
from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.collect.rollout import JUDGING_SEED, play
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.make import make_gym
from ibe_rl.evaluation.moments import SEEN_STEPS, Moments, Plan
from ibe_rl.evaluation.rollouts import predict_futures, take_moments
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.checkpoint import load, policies
from ibe_rl.task import Task
from ibe_rl.types import Episode

ROOT = Path(__file__).parents[2]
SEEDS = range(JUDGING_SEED, JUDGING_SEED + 3)
PLAN = Plan(stride_steps=20, futures=2, horizons_steps=(5, 30), observer_steps=30)


def make() -> Any:
    return make_gym(LANDER_ID, {})


@pytest.fixture(scope="module")
def policy() -> Any:
    [path] = policies(ROOT / "demo" / "checkpoints").values()
    agent = make_agent(PPOConfig(), LANDER_TASK.observation_size, make().action_space, 1)
    agent.greedy.load_state_dict(load(path))
    return agent.greedy


def rolled_out(policy: Any, plan: Plan = PLAN, kind: str = "oracle", task: Task = LANDER_TASK) -> Moments:
    run: Any = SimpleNamespace(
        folder=None, make_env=make, task=task, config=SimpleNamespace(instructor=InstructorConfig(kind))
    )
    taken = take_moments(run, policy, SEEDS, plan)
    return predict_futures(taken, policy, Simulator(make, LANDER_TASK.rule), plan, "futures")


@pytest.fixture(scope="module")
def moments(policy: Any) -> Moments:
    return rolled_out(policy)


@pytest.fixture(scope="module")
def episodes(policy: Any) -> list[Episode]:
    return play([make()], policy, make_instructor(InstructorConfig("oracle"), LANDER_TASK), SEEDS)


def test_moments_are_those_of_the_episodes(moments: Moments, episodes: list[Episode]):
    assert len(moments) == len(moments.step) > 20
    assert sorted(set(moments.episode)) == [0, 1, 2]
    np.testing.assert_array_equal(moments.seed, np.array(SEEDS)[moments.episode])
    for row in range(len(moments)):
        episode, step = episodes[moments.episode[row]], moments.step[row]
        np.testing.assert_array_equal(moments.state[row], episode.states[step])
        np.testing.assert_array_equal(moments.instruction[row], episode.instructions[step])
        for at, ahead in enumerate((5, 30)):
            end = min(step + ahead, len(episode))
            np.testing.assert_array_equal(moments.realised[row, at], episode.states[end] - episode.states[step])


def test_every_so_many_steps_and_once_for_the_observer(moments: Moments, episodes: list[Episode]):
    for number, episode in enumerate(episodes):
        here = moments[moments.episode == number]
        assert here.step[here.regular].tolist() == list(range(0, len(episode), 20))
        contact = LANDER_TASK.first_contact(episode.states) if LANDER_TASK.first_contact else 0
        assert contact > SEEN_STEPS + 30
        assert here.step[here.observed].tolist() == [contact - 30]
        assert (here.regular | here.observed).all()


def test_without_a_contact_the_end_is_foretold(policy: Any, episodes: list[Episode]):
    found = rolled_out(policy, task=replace(LANDER_TASK, first_contact=None))
    assert found.step[found.observed].tolist() == [len(episode) - 30 for episode in episodes]


def test_who_lands_too_early_is_not_observed(policy: Any):
    assert not rolled_out(policy, Plan(50, 1, (5,), observer_steps=900)).observed.any()
    assert not rolled_out(policy, Plan(50, 1, (5,))).observed.any()


def test_futures_are_near_what_came_and_differ(moments: Moments):
    assert moments.predicted.shape == (len(moments), 2, 2, 9)
    flying = (moments.state[:, 1] > 0.3) & moments.regular
    gap = np.abs(moments.predicted[flying, :, 0, 0] - moments.realised[flying, None, 0, 0])
    assert np.median(gap) < 0.01
    assert (moments.predicted[:, 0] != moments.predicted[:, 1]).any(axis=(1, 2)).mean() > 0.5
    assert np.abs(moments.predicted[:, :, 1, 8]).max() == 0  # the goal does not move


def test_a_short_horizon_is_the_beginning_of_a_long_one(policy: Any, moments: Moments):
    alone = rolled_out(policy, Plan(20, 2, (30,), observer_steps=30))
    np.testing.assert_allclose(alone.predicted[:, :, 0], moments.predicted[:, :, 1], atol=1e-3)
    np.testing.assert_array_equal(alone.realised[:, 0], moments.realised[:, 1])


def test_only_moments_on_the_stride_with_an_instruction_are_judged(policy: Any, moments: Moments):
    assert len(moments.judged()) == moments.regular.sum() < len(moments)
    assert len(rolled_out(policy, Plan(50, 1, (5,)), "silent").judged()) == 0


def test_the_first_future_alone(moments: Moments):
    assert moments.first_future().predicted.shape[1] == 1
    np.testing.assert_array_equal(moments.first_future().predicted[:, 0], moments.predicted[:, 0])
    assert moments.at(30) == 1
