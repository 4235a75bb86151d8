"""Agents of stable-baselines3 that read dicts, images and tables act as they do in their own library."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import stable_baselines3 as sb3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from walker import walker

from ibe_rl.apps.external.adapters import KeyStatistics, Statistics
from ibe_rl.apps.external.finding import statistics_of
from ibe_rl.apps.external.policy import as_policy
from ibe_rl.apps.external.reading import Reading
from ibe_rl.envs.wrappers import task_of
from ibe_rl.task import PERCEPT
from ibe_rl.types import ConfigError, observe


def trained(env: Any, policy: str) -> Any:
    return sb3.PPO(policy, env.unwrapped, n_steps=8, batch_size=8, n_epochs=1, seed=0, device="cpu").learn(8)


def wrapped(model: Any, env: Any, reading: Reading | None = None) -> Any:
    task, first = task_of(env), [env.reset(seed=seed) for seed in range(5)]
    states = np.array([state for state, _ in first])
    percepts = np.array([info.get(PERCEPT, state) for state, info in first])
    examples = observe(percepts, task.rule(states), np.ones((5, 1)))
    return as_policy(model, task, env.action_space, reading or Reading(), examples, [env] * 5), examples


@pytest.mark.parametrize(
    ("obs", "policy"),
    [
        ("dict", "MultiInputPolicy"),
        ("camera", "CnnPolicy"),
        ("row", "MlpPolicy"),
        ("multidiscrete", "MlpPolicy"),
        ("multibinary", "MlpPolicy"),
    ],
)
def test_it_acts_as_in_its_own_library(obs: str, policy: str) -> None:
    env = walker(obs)
    model = trained(env, policy)
    acting, examples = wrapped(model, env)
    own = []
    for seed in range(5):
        env.reset(seed=seed)
        own.append(int(model.predict(env.unwrapped.seen(), deterministic=True)[0]))
    assert acting(examples).tolist() == own


def test_parts_that_were_normalised_are_normalised_as_there() -> None:
    env = walker("dict")
    there = VecNormalize(DummyVecEnv([lambda: env.unwrapped]), norm_obs_keys=["here"])
    model = sb3.PPO("MultiInputPolicy", there, n_steps=64, batch_size=64, n_epochs=1, seed=0, device="cpu").learn(64)
    inside = SimpleNamespace(predict=lambda seen, **_: (seen["here"][:, 1] > seen["goal"][:, 0], None))
    inside.observation_space = model.observation_space
    for agent in (model, inside):
        acting, examples = wrapped(agent, env, Reading(statistics=statistics_of(there)))
        seen = []
        for seed in range(5):
            env.reset(seed=seed)
            seen.append({key: np.array(part)[None] for key, part in env.unwrapped.seen().items()})
        own = [int(agent.predict(there.normalize_obs(one), deterministic=True)[0][0]) for one in seen]
        assert acting(examples).tolist() == own


def test_statistics_of_other_parts_are_refused() -> None:
    numbers = Statistics(np.zeros(2), np.ones(2), 1e-8, 10.0)
    refusal = r"^agent_vec_normalize: its statistics are of observations of other shapes or keys; allowed are those of "
    for obs, statistics in (("dict", KeyStatistics({"far": numbers})), ("dict", numbers), ("row", numbers)):
        env = walker(obs)
        model = trained(env, "MultiInputPolicy" if obs == "dict" else "MlpPolicy")
        with pytest.raises(ConfigError, match=refusal):
            wrapped(model, env, Reading(statistics=statistics))
    flat = walker("box")
    with pytest.raises(ConfigError, match=r"^agent_vec_normalize: its statistics are of the keys here; allowed"):
        wrapped(trained(flat, "MlpPolicy"), flat, Reading(statistics=KeyStatistics({"here": numbers})))


def test_parts_that_differ_are_refused() -> None:
    model = trained(walker("dict"), "MultiInputPolicy")
    with pytest.raises(ConfigError, match=r"^agent: it reads observations Dict\(.*allowed are the environment's, Box"):
        wrapped(model, walker("row"))


def test_frames_of_parts_are_refused() -> None:
    env = walker("dict")
    with pytest.raises(ConfigError, match=r"^agent_frame_stack: its observations are Dict"):
        wrapped(trained(env, "MultiInputPolicy"), env, Reading(frames=2))
