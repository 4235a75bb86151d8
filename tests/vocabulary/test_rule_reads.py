"""Dimensions on which no word turns are refused before a training, by asking the rule in a few random states."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rules import WORDS, declared

from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of
from ibe_rl.ibe import IBEConfig
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError
from ibe_rl.vocabulary.rule_reads import FEW_STATES, RANDOM_STEPS, check_dimensions, lead_on, random_states, reads


@pytest.fixture(scope="module")
def env() -> Any:
    return make_gym("CartPole-v1", {}, declared())


def reading(task: Task, *columns: int) -> Task:
    """Told to go against the sum of these dimensions, one number; near 0 nothing."""

    def rule(states: Array) -> Array:
        ahead = states[..., list(columns)].sum(axis=-1, keepdims=True)
        return -np.sign(ahead) * (np.abs(ahead) > 0.05)

    return replace(task, rule=rule)


def mapping(*dimensions: str, **changes: Any) -> IBEConfig:
    return IBEConfig(**({"space": "rule", "dimensions": list(dimensions)} | changes))


def test_the_states_are_the_same_each_time_and_not_too_many(env: Any):
    states = random_states(env, RANDOM_STEPS)
    assert states.shape == (RANDOM_STEPS, 4)
    np.testing.assert_array_equal(random_states(env, RANDOM_STEPS), states)
    assert len(np.unique(states[:, 0])) > RANDOM_STEPS / 2


def test_what_the_rule_reads_is_found(env: Any):
    states, task = random_states(env, RANDOM_STEPS), task_of(env)
    assert reads(states, reading(task, 0), 0).tolist() == [True, False, False, False]
    assert reads(states, reading(task, 1, 2), 0).tolist() == [False, True, True, False]


def test_dimensions_that_the_rule_does_not_read_are_refused(env: Any):
    task = reading(task_of(env), 0)
    with pytest.raises(ConfigError) as refused:
        check_dimensions(mapping("state_3"), task, env)
    assert str(refused.value) == (
        "mapping.dimensions=['state_3']: the instructor's rule does not depend on them, it reads state_0; allowed is "
        "[], or mapping=lasso or mapping.space=all, which compare these dimensions whatever the rule reads"
    )


def test_a_slow_environment_is_stepped_no_longer_than_it_takes(env: Any, monkeypatch: pytest.MonkeyPatch):
    taken, step = [], env.step
    monkeypatch.setattr(env, "step", lambda action: [taken.append(1), step(action)][1])
    task = reading(task_of(env), 0)
    check_dimensions(mapping("state_0"), task, env)
    assert len(taken) < FEW_STATES
    with pytest.raises(ConfigError):
        check_dimensions(mapping("state_3"), task, env)
    assert len(taken) > RANDOM_STEPS / 2


def test_of_several_numbers_the_one_is_named(env: Any):
    two: dict[str, Any] = {"rule": "rules:both", "phrases": [WORDS, WORDS], "explained": ["state_0", "state_2"]}
    task = task_of(make_gym("CartPole-v1", {}, declared(**two, explained_band=[0.1, 0.2])))
    check_dimensions(mapping("state_0", "state_2"), task, env)
    with pytest.raises(
        ConfigError, match=r"the instructor's rule of state_2 does not depend on them, it reads state_2"
    ):
        check_dimensions(mapping("state_0"), task, env)


def test_what_can_work_passes(env: Any):
    task = reading(task_of(env), 0)
    assert check_dimensions(mapping("state_0", "state_3"), task, env) == []
    assert check_dimensions(mapping(), task, env) == []
    assert check_dimensions(mapping("state_3", space="all"), task, env) == []
    silent = replace(task, rule=lambda states: np.zeros((*states.shape[:-1], 1)))
    assert check_dimensions(mapping("state_3"), silent, env) == []  # nothing can be known yet


def test_a_dimension_that_goes_with_what_is_read_passes(env: Any):
    """The rule reads a copy of the first dimension, so that the axis lies on both."""
    task = reading(task_of(env), 4)
    assert (
        check_dimensions(mapping("state_0"), replace(task, state_names=(*task.state_names, "copy")), Twice(env)) == []
    )


def test_a_dimension_that_stands_still_is_noted(env: Any):
    task = replace(reading(task_of(env), 0), state_names=("state_0", "b", "c", "d", "still"))
    noted = check_dimensions(mapping("state_0", "still"), task, Twice(env, 0.0))
    assert noted == ["mapping.dimensions: still did not change in random episodes"]


def test_when_refreshes_are_skipped_again_and_again_it_is_said_what_can_be_done():
    assert lead_on(mapping("a"), 1) == ""
    said = lead_on(mapping("a"), 3)
    assert said.startswith(
        "; 3 refreshes were skipped so far and there are no words yet: train longer, leave mapping.dim"
    )
    assert "mapping=lasso" in said
    assert "mapping=lasso" not in lead_on(mapping(space="all"), 2)
    assert "mapping.dimensions" not in lead_on(mapping(), 2)


class Twice:
    """The cart-pole with its first dimension, times something, once more behind the others."""

    def __init__(self, env: Any, times: float = 1.0):
        self._env, self._times, self.action_space = env, times, env.action_space

    def reset(self, seed: int) -> tuple[Array, Any]:
        state, info = self._env.reset(seed=seed)
        return self._more(state), info

    def step(self, action: Any) -> tuple[Any, ...]:
        state, *others = self._env.step(action)
        return self._more(state), *others

    def _more(self, state: Array) -> Array:
        return np.append(state, self._times * state[0])


def test_where_random_play_hardly_hears_anything_states_farther_out_are_asked(env: Any):
    """Random play never gets so far that anything but 0 is said; what is read shows all the same."""
    task = task_of(env)
    far = replace(task, rule=lambda states: np.sign(states[..., :1]) * (np.abs(states[..., :1]) > 0.6))
    assert not np.any(far.rule(random_states(env, RANDOM_STEPS)))
    with pytest.raises(ConfigError, match="does not depend on them, it reads state_0;"):
        check_dimensions(mapping("state_2"), far, env)
    assert check_dimensions(mapping("state_0"), far, env) == []
