"""Predictors where the agent does not perceive the state: the policy gets percepts, the prediction is of the state."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from walker import SIZES, to_middle, walker, walker_config

from ibe_rl.collect.rollout import play, record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.ensemble import Ensemble, EnsembleConfig
from ibe_rl.predict.regression import Regression, RegressionConfig
from ibe_rl.predict.simulator import Simulator
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, ConfigError

SETTINGS = EnsembleConfig(members=2, hidden=[16], updates=60, minibatch_size=128)


def parity(observations: Array) -> Array:
    """A policy that depends on the whole percept."""
    return np.where(np.floor(observations[:, :-2].sum(axis=1)) % 2 == 0, 2, 0)


def recorded(obs: str) -> Any:
    env = walker(obs)
    return record_rollout(env, parity, make_instructor(InstructorConfig("oracle"), task_of(env)), 3)


@pytest.mark.parametrize("obs", SIZES)
def test_the_simulator_goes_where_the_game_went(obs: str):
    watched = recorded(obs)
    simulator = Simulator(partial(make_snapshot_env, walker_config(obs)), to_middle, "rule", own_noise=False)
    found = simulator.rollout(watched.moments[::10], parity, 10)
    states = watched.episode.states
    np.testing.assert_array_equal(found.paths, [states[start : start + 11] for start in (0, 10, 20)])


def logged(obs: str, folder: Path) -> TrajectoryLog:
    env, log = walker(obs), TrajectoryLog(folder, 10_000, ["any"])
    instructor = make_instructor(InstructorConfig("oracle"), task_of(env))
    for episode in play([env], lambda seen: np.arange(len(seen)) % 3 + len(seen) // 2, instructor, range(40)):
        log.add(episode.as_steps(), lambda _: "any")
    return log


@pytest.mark.parametrize("obs", ["dict", "tuple", "discrete", "box"])
def test_the_ensemble_learns_state_and_percept_together(obs: str, tmp_path: Path):
    torch.set_num_threads(1)
    env, watched = walker(obs), recorded(obs)
    Ensemble.check(SETTINGS, env)
    one, other = (Ensemble.make(SETTINGS, rule=to_middle, seed=0, env=env) for _ in range(2))
    one.learn(logged(obs, tmp_path))
    seen: list[Array] = []

    def keeps(observations: Array) -> Array:
        seen.append(observations.copy())
        return parity(observations)

    found = one.rollout(watched.moments[:4], keeps, 5)
    assert found.paths.shape == (4, 6, 2)
    np.testing.assert_array_equal(found.paths[:, 0], watched.episode.states[:4])
    percepts = watched.episode.states if watched.episode.percepts is None else watched.episode.percepts
    assert {row.tobytes() for row in seen[0][:, :-2]} == {row.tobytes() for row in percepts[:4].astype(np.float32)}
    other.load_state_dict(one.state_dict())
    np.testing.assert_array_equal(other.rollout(watched.moments[:4], parity, 5).paths, found.paths)


@pytest.mark.parametrize("obs", ["image", "mixed"])
def test_the_ensemble_refuses_images_and_the_regression_reads_the_state(obs: str, tmp_path: Path):
    with pytest.raises(ConfigError, match=r"predictor=ensemble: .* an image of \(6, 8, 3\).* allowed is .*simulator"):
        Ensemble.check(SETTINGS, walker(obs))
    regression = Regression(RegressionConfig(), 0, lambda: [5])
    regression.learn(logged(obs, tmp_path))
    assert regression.rollout(recorded(obs).moments[:3], parity, 5).paths.shape == (3, 6, 2)
