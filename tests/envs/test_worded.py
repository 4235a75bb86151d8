"""A task whose instructions are words: who says which, and which settings cannot work."""

from dataclasses import replace

import numpy as np
import pytest

from ibe_rl.config.settings import CollectConfig, EnvConfig, InstructorConfig
from ibe_rl.envs import LANDER_ID, LANDER_TASK
from ibe_rl.envs.lander_speed_task import LANDER_SPEED_TASK
from ibe_rl.envs.lander_words_task import LANDER_WORDS_TASK, say_one_word
from ibe_rl.envs.make import make_env
from ibe_rl.envs.worded import has_rule, worded
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import check_instructor, make_instructor
from ibe_rl.instructors.flawed import FlawedConfig
from ibe_rl.types import Array, ConfigError


def at(x: float, y: float = 0.0, vy: float = -0.08) -> Array:
    state = np.zeros(9, np.float32)
    state[[0, 1, 3]] = x, y, vy
    return state


BESIDE = np.stack([at(0.5), at(0.0), at(-0.5)])
"""Right of the pad, above it, left of it."""


def test_the_words_are_those_of_the_values_in_order():
    task = worded(LANDER_TASK, ["links", "halt", "rechts"], 5)
    assert task.words is not None
    assert task.words.names == ("links", "halt", "rechts")
    np.testing.assert_array_equal(task.rule(BESIDE), np.eye(5)[[0, 1, 2]])
    assert (task.instruction_size, task.directions, task.number_names) == (5, (-1.0, 0.0, 1.0), ("x",))
    assert task.expression_names[:2] == ("links", "halt")
    assert LANDER_TASK.words is None


def test_a_task_with_words_of_its_own_can_be_given_others():
    task = worded(LANDER_WORDS_TASK, ["a", "b", "c", "d", "e"])
    assert task.words is not None
    assert task.words.names == ("a", "b", "c", "d", "e")
    own = worded(LANDER_WORDS_TASK, [], 8)
    assert own.words is not None
    own.words.add("another")
    assert LANDER_WORDS_TASK.instruction_size == 5  # which no run shares
    np.testing.assert_array_equal(own.rule(BESIDE[:1])[0], np.eye(8)[0])


def test_the_most_needed_of_five_words_is_said():
    states = np.stack([at(0.5), at(-0.5), at(0.0), at(0.0, vy=0.1), at(0.0, vy=-0.5), at(0.3, vy=-0.5)])
    np.testing.assert_array_equal(say_one_word(states).argmax(axis=1), [0, 1, 2, 3, 4, 4])


def test_a_rule_that_cannot_say_the_words_is_silent_and_refused_as_an_instructor():
    for task in (worded(LANDER_TASK, ["up", "down"]), worded(LANDER_SPEED_TASK, ["a", "b", "c"])):
        assert not has_rule(task)
        said, given = make_instructor(InstructorConfig("oracle"), task).instruct(BESIDE, np.ones(3, bool))
        assert not said.any()
        assert not given.any()
        for kind in (InstructorConfig("oracle"), FlawedConfig()):
            with pytest.raises(ConfigError, match=r"instructor\.words=.*cannot say them; allowed are as many words"):
                check_instructor(kind, CollectConfig(), task)


def test_more_places_without_words_are_refused():
    with pytest.raises(ConfigError, match=r"instructor\.max_words=3: allowed beside instructor\.words"):
        worded(LANDER_TASK, [], 3)


def test_every_environment_of_a_run_has_the_words():
    task = task_of(make_env(EnvConfig(LANDER_ID, words=["links", "halt", "rechts"], max_words=4)))
    assert (task.instruction_size, task.observation_size) == (4, 14)


def test_a_flawed_one_says_another_word():
    task = worded(LANDER_TASK, ["links", "halt", "rechts"], 6)
    flawed = make_instructor(FlawedConfig(wrong=1.0, spell_steps=1), task, seed=3)
    flawed.reset(np.ones(300, bool))
    said, given = flawed.instruct(np.tile(BESIDE, (100, 1)), np.ones(300, bool))
    assert given.all()
    assert (said.sum(axis=1) == 1).all()
    assert not (said * task.rule(np.tile(BESIDE, (100, 1)))).any()
    assert said[:, :3].any(axis=0).all()
    assert not said[:, 3:].any()  # there is no word yet


def test_a_task_of_words_need_not_explain_a_dimension_for_each():
    assert replace(LANDER_WORDS_TASK, explained=(0,), explained_band=(0.1,), explained_range=()).instruction_size == 5
