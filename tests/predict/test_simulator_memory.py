"""Copies of the environment that are forgotten are gone, whatever circles they are held in."""

import gc
import weakref
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ibe_rl.collect.rollout import record_rollout
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs.make import make_gym
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import make_instructor
from ibe_rl.predict.simulator import Simulator

ENV = "ibe_rl/LunarLanderPads-v0"


@pytest.fixture
def no_collector() -> Iterator[None]:
    """As between two of its rare rounds."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_collector")
def test_what_is_forgotten_is_gone():
    made: list[weakref.ref[Any]] = []

    def make() -> Any:
        env = make_gym(ENV, {})
        made.append(weakref.ref(env.unwrapped))
        return env

    env = make_gym(ENV, {})
    simulator = Simulator(make, task_of(env).rule)
    watched = record_rollout(
        env, lambda seen: np.zeros(len(seen), int), make_instructor(InstructorConfig(), task_of(env), 0), 3
    )
    simulator.rollout(watched.moments[:4], lambda seen: np.zeros(len(seen), int), 3)
    assert len([one for one in made if one() is not None]) == 4
    simulator.forget()
    assert [one for one in made if one() is not None] == []
