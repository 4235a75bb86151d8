"""Before a training its environment is tried in each way that the run will play it."""

from typing import Any

import awkward  # registers the environments
import gymnasium
import numpy as np
import pytest

from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs import LANDER_ID
from ibe_rl.envs.errors import GateError
from ibe_rl.envs.giving import given_env
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.envs.snapshots import Wrapped, step_games, stoppable
from ibe_rl.envs.trial import try_out
from ibe_rl.types import ConfigError


def lift(env_id: str = "Lift", **declared: Any) -> EnvConfig:
    return EnvConfig(id=f"awkward:tests/{env_id}-v0", task=awkward.declared_lift(**declared))


@pytest.mark.parametrize("config", [EnvConfig(id=LANDER_ID), lift(), lift("SameBuffer"), lift("Stopped")])
def test_nothing_is_noted_of_what_is_in_order(config: EnvConfig):
    assert try_out(config, simulated=True) == []


def test_a_seed_that_is_ignored_is_noted():
    given = given_env(lambda: awkward.Lift(seeded=False), awkward.lift_task())
    [note] = try_out(given, simulated=False)
    assert "ignores the seed" in note


def test_scales_that_differ_are_noted():
    def far(_: int, given: list[Any]) -> Any:
        return (given[0] * np.float32([1e4, 1]), *given[1:])

    [note] = try_out(given_env(lambda: awkward.Lift(far), awkward.lift_task()), simulated=False)
    assert "-fold: height reaches" in note


def test_a_rule_that_never_changes_is_noted():
    [note] = try_out(lift(rule="awkward_rules:always_up"), simulated=False)
    assert "the rule says 1 of height in all" in note


def test_a_rule_that_reads_several_states_at_once_is_refused():
    with pytest.raises(
        ConfigError, match=r"env\.task\.rule=.*together with other states; allowed is a rule that reads each"
    ):
        try_out(lift(rule="awkward_rules:of_all"), simulated=False)


def test_all_functions_are_called_with_states_of_an_episode():
    with pytest.raises(GateError, match=r"env\.task\.first_contact=awkward_rules:always_up: it returned"):
        try_out(lift(first_contact="awkward_rules:always_up"), simulated=False)
    assert try_out(lift(motion="awkward_rules:speed"), simulated=False) == []


def test_snapshots_that_forget_are_refused_if_they_are_needed():
    assert try_out(lift("Forgetful"), simulated=False) == []
    with pytest.raises(
        ConfigError, match=r"predictor=simulator .* its height is off by .*allowed is predictor=ensemble"
    ):
        try_out(lift("Forgetful"), simulated=True)


def test_a_game_in_a_wrapper_that_changes_its_step_is_rolled_out_in_the_wrapper():
    env, copy = make_env(lift("Twice")), make_snapshot_env(lift("Twice"))
    game = stoppable(env)
    assert isinstance(game, Wrapped)
    assert try_out(lift("Twice"), simulated=True) == []
    env.reset(seed=3)
    copy.reset(seed=4)
    copy.restore(game.snapshot())
    np.testing.assert_array_equal(copy.step(2)[0], env.step(2)[0])


def test_a_rollout_is_checked_too():
    def broken(_: int, given: list[Any]) -> Any:
        return (given[0] * np.nan, *given[1:])

    games: Any = [awkward.Lift(broken), awkward.Lift(lambda *_: 1 / 0)]
    for game in games:
        game.reset(seed=0)
    with pytest.raises(GateError, match=r"Lift, a roll-out from a snapshot: the observation is \[nan, nan\]"):
        step_games(games[:1], [1])
    with pytest.raises(GateError, match=r"its step\(\) raised ZeroDivisionError"):
        step_games(games[1:], [1])


def test_an_environment_that_breaks_is_not_taken_for_one_that_cannot_be_copied():
    gymnasium.register("tests/Breaks-v0", lambda: awkward.Lift(lambda *_: 1 / 0), max_episode_steps=9)
    with pytest.raises(GateError, match="its step\\(\\) raised ZeroDivisionError"):
        make_snapshot_env(lift("Breaks"))


class Own(awkward.Lift):
    task = awkward.lift_task()


def test_a_task_of_its_own_needs_a_time_limit():
    gymnasium.register("tests/Endless-v0", Own)
    with pytest.raises(ConfigError, match=r"registered without a time limit; allowed is max_episode_steps=12"):
        make_env(EnvConfig(id="tests/Endless-v0"))


def test_an_episode_ends_when_its_task_says():
    gymnasium.register("tests/Long-v0", Own, max_episode_steps=50)
    env = make_env(EnvConfig(id="tests/Long-v0"))
    env.reset(seed=0)
    steps = [env.step(1) for _ in range(12)]
    assert [truncated for _, _, _, truncated, _ in steps] == [False] * 11 + [True]
