"""Environments that a program gives: functions, classes, objects and ids, with their task beside them."""

from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gates import STEPS, Closed, Gate, task

from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs.given import GivenEnv
from ibe_rl.envs.giving import given_env
from ibe_rl.envs.make import make_env, make_snapshot_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.types import ConfigError


@pytest.mark.parametrize("env", [Gate, lambda: Gate(), Gate()], ids=["class", "function", "object"])
def test_it_has_its_task_and_time_limit_in_this_and_other_processes(env: Any) -> None:
    given = given_env(env, task())
    assert (given.given, task_of(make_env(given)).name) == (True, "Gate")
    sent: GivenEnv = cloudpickle.loads(cloudpickle.dumps(given))
    for made in (make_env(given), make_env(sent)):
        state, info = made.reset(seed=3)
        assert (state.dtype, info["success"]) == (np.float32, False)
        ends = [made.step(2)[2:4] for _ in range(STEPS)]
        assert ends == [(False, False)] * (STEPS - 1) + [(False, True)]
    assert (sent.id, sent.token) == (given.id, given.token)


def test_an_object_is_copied_and_left_alone() -> None:
    mine = Gate()
    mine.reset(seed=0)
    before = mine.state.copy()
    given = given_env(mine, task())
    one, other = make_env(given), make_env(given)
    one.reset(seed=1)
    other.reset(seed=2)
    one.step(2)
    np.testing.assert_array_equal(mine.state, before)
    assert one.unwrapped is not other.unwrapped


def test_its_future_can_be_predicted_in_a_copy() -> None:
    """Gymnasium knows no id of it: others are made in the way that was given."""
    copy = make_snapshot_env(given_env(Gate, task()))
    copy.reset(seed=1)
    copy.step(2)
    kept, after = copy.snapshot(), copy.step(0)[0]
    copy.step(2)
    copy.restore(kept)
    np.testing.assert_array_equal(copy.step(0)[0], after)


def test_a_shorter_time_limit_counts() -> None:
    env = make_env(given_env(lambda: gymnasium.make("CartPole-v1"), cart_task(max_episode_steps=7)))
    env.reset(seed=0)
    assert [env.step(i % 2)[3] for i in range(7)] == [False] * 6 + [True]


def cart_task(**changes: Any) -> Any:
    names = ("x", "vx", "angle", "turning")
    return task(state_names=names, state_units=("", "", "", ""), **changes)


def test_its_own_drawing_and_task_are_taken() -> None:
    class Drawn(Gate):
        task = task(name="its own")

        def figure(self) -> list[str]:
            return ["a shape"]

    made = make_env(given_env(Drawn))
    assert (task_of(made).name, made.get_wrapper_attr("figure")()) == ("its own", ["a shape"])
    assert made.get_wrapper_attr("background")() == []


def fails() -> Gate:
    raise RuntimeError("no gate")


def wide(states: np.ndarray) -> np.ndarray:
    return np.ones((len(states), 2))


@pytest.mark.parametrize(
    ("env", "declared", "message"),
    [
        (Gate, None, r"env=gates.Gate: it declares no task; allowed is task=Task"),
        (fails, task(), r"env=test_given.fails: it cannot be made \(RuntimeError: no gate\)"),
        (dict, task(), r"env=builtins.dict: it made dict; allowed is a gymnasium environment"),
        (3, task(), r"env=3: allowed is a name, a function or class"),
        (Closed(), task(), r"env=gates.Closed: this object cannot be copied \(TypeError: .*allowed is a function"),
        (Gate, task(state_names=("width",)), r"task.state_names=\['width'\] with env=gates.Gate: allowed are 2"),
        (Gate, task(state_units=("m",)), r"task.state_units=\['m'\]"),
        (Gate, task(rule=wide), r"task.rule=test_given.wide: for 2 states it gave an array of shape \(2, 2\)"),
        (
            Gate,
            task(contexts=("up",)),
            r"task.context=gates.any_of: it returned 'any' for the state .*; allowed is one of up",
        ),
    ],
)
def test_what_does_not_fit_is_refused_at_once(env: Any, declared: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        given_env(env, declared)


def test_a_config_alone_gives_none() -> None:
    with pytest.raises(ConfigError, match=r"env.given=true with env.id=Gate: allowed only in Python"):
        make_env(EnvConfig(id="Gate", given=True))
