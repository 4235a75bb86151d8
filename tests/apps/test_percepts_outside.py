"""Where the agent does not perceive the state: lessons, agents trained elsewhere and datasets get the percept."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box
from walker import SIZES, walker

from ibe_rl.apps.datasets.exporting import _buffer
from ibe_rl.apps.datasets.instruction_source import InstructionSource
from ibe_rl.apps.datasets.recorded import Conversion, RawEpisode
from ibe_rl.apps.external.policy import as_policy
from ibe_rl.apps.external.reading import Reading
from ibe_rl.apps.teach.lesson import Stage
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.task import PERCEPT
from ibe_rl.types import Array, ConfigError


def stay(observations: Array) -> Array:
    return np.ones(len(observations), np.int64)


def test_a_lesson_has_the_percept_of_its_state():
    stage = Stage(walker("image"))
    np.testing.assert_array_equal(stage.reset(seed=0)[1][PERCEPT], stage.percept)
    np.testing.assert_array_equal(stage.step(2)[4][PERCEPT], stage.percept)
    plain = Stage(walker("box"))
    plain.reset(seed=0)
    assert plain.percept is None


@pytest.mark.parametrize(("sees", "numbers"), [(False, SIZES["dict"]), (True, SIZES["dict"] + 2)])
def test_an_agent_trained_elsewhere_reads_the_observation_as_a_row(sees: bool, numbers: int):
    env = walker("dict")
    read: list[int] = []

    def agent(observations: Array) -> Array:
        read.append(observations.shape[-1])
        return stay(observations)

    task = task_of(env)
    policy = as_policy(agent, task, env.action_space, Reading(sees), np.zeros((5, task.observation_size), np.float32))
    assert policy.seen == numbers
    assert {*read} == {numbers}
    allowed = r"allowed is one that reads the observation as one row, 5 numbers, or with the instruction .* given 7"
    spaced: Any = SimpleNamespace(observation_space=Box(-1, 1, (3,)), predict=stay)
    with pytest.raises(ConfigError, match=allowed):
        as_policy(spaced, task, env.action_space, Reading(), np.zeros((5, 7), np.float32))


@pytest.mark.parametrize("obs", ["image", "dict", "box"])
def test_a_dataset_keeps_percepts(obs: str):
    env = walker(obs)
    task = task_of(env)
    episode = record_rollout(env, stay, make_instructor(InstructorConfig("oracle"), task), 0).episode
    minari = SimpleNamespace(data_collector=SimpleNamespace(EpisodeBuffer=SimpleNamespace))
    buffer = _buffer(minari, episode, task, None)
    columns = ("observations", "actions", "rewards", "terminations", "truncations", "infos")
    recorded = RawEpisode("a/b-v0", *(getattr(buffer, name) for name in columns))
    again = Conversion(task, env.action_space, InstructionSource.found(task, None, recorded, True))(recorded)
    np.testing.assert_array_equal(again.states, episode.states)
    np.testing.assert_array_equal(again.instructions, episode.instructions)
    if episode.percepts is None:
        assert again.percepts is None
    else:
        assert again.percepts is not None
        assert again.percepts.dtype == episode.percepts.dtype
        np.testing.assert_array_equal(again.percepts, episode.percepts)
