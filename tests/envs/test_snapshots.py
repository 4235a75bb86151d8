"""A game that is stopped and taken up elsewhere goes on as if nothing had been, in each way of stopping it."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from rules import declared

from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.envs.snapshots import Copied, MuJoCo, repeats, stoppable
from ibe_rl.types import ConfigError

WAYS: dict[str, type] = {
    "CartPole-v1": Copied,
    "Pendulum-v1": Copied,
    "MountainCarContinuous-v0": Copied,
    "Reacher-v5": MuJoCo,
    "InvertedPendulum-v5": MuJoCo,
}


class Hidden(gymnasium.Env[Any, Any]):
    """Its next state depends on something that no copy brings along."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)
    action_space = gymnasium.spaces.Discrete(2)
    steps = 0

    def reset(self, **_: Any) -> Any:
        return np.zeros(1, np.float32), {}

    def step(self, _: Any) -> Any:
        Hidden.steps += 1
        return np.full(1, Hidden.steps, np.float32), 0.0, False, False, {}


class Held(Hidden):
    """It cannot be copied at all."""

    def __deepcopy__(self, _: Any) -> Any:
        raise TypeError("cannot pickle the engine")


for kind in (Hidden, Held):
    gymnasium.register(f"tests/{kind.__name__}-v0", kind, max_episode_steps=9)


def make(env_id: str) -> Any:
    return gymnasium.make(env_id, disable_env_checker=True)


@pytest.mark.parametrize("env_id", WAYS)
def test_a_game_taken_up_in_another_copy_repeats_the_original(env_id: str):
    one, other = stoppable(make(env_id)), stoppable(make(env_id))
    assert one is not None
    assert other is not None
    assert type(one) is WAYS[env_id]
    assert repeats(one, other, steps=20)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Reacher-v5"])
def test_a_snapshot_stays_as_it_is(env_id: str):
    env = make(env_id)
    game, other = stoppable(env), stoppable(make(env_id))
    assert game is not None
    assert other is not None
    env.reset(seed=0)
    other.reset(seed=5)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(9)]
    snapshot = game.snapshot()
    really = [env.step(action)[0] for action in actions]
    for _ in range(2):
        other.restore(snapshot)
        np.testing.assert_array_equal([other.step(action)[0] for action in actions], really)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Reacher-v5"])
def test_chance_can_be_another_one(env_id: str):
    env = make(env_id)
    game = stoppable(env)
    assert isinstance(game, Copied)
    env.reset(seed=0)
    noise = np.random.default_rng(7)
    game.restore(game.snapshot(), noise)
    assert game.game.unwrapped.np_random is noise


def test_the_time_limit_is_not_part_of_the_game():
    env = make("CartPole-v1")
    env.reset(seed=0)
    game = stoppable(env)
    assert isinstance(game, Copied)
    assert game.game is env.unwrapped


def test_a_game_with_snapshots_of_its_own_is_itself():
    env = make(LANDER_ID)
    assert stoppable(env) is env.unwrapped


def test_what_a_copy_does_not_repeat_is_not_stopped():
    assert not repeats(Copied(make("tests/Hidden-v0").unwrapped), Copied(make("tests/Hidden-v0").unwrapped))
    assert stoppable(make("tests/Hidden-v0")) is None
    assert stoppable(make("tests/Held-v0")) is None
    assert stoppable(Hidden()) is None  # nothing says how to make another one
    assert stoppable(make("LunarLander-v3")) is None


def test_a_simulator_in_what_cannot_be_stopped_is_refused():
    with pytest.raises(ConfigError, match=r"predictor=simulator with env\.id=tests/Hidden-v0: the state of"):
        make_snapshot_env(EnvConfig("tests/Hidden-v0", {}, declared()))
