"""What an environment's constructor declares as a bool is one."""

from collections.abc import Iterator
from typing import Any

import gymnasium
import pytest

from ibe_rl.envs.make import make_gym
from ibe_rl.types import ConfigError

NOTHING: Any = None


class Flagged(gymnasium.Env[Any, Any]):
    observation_space = action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, flat: bool = False, name: str = "", wide: "bool" = True, late: bool = NOTHING):
        del flat, name, wide, late


@pytest.mark.parametrize("key", ["flat", "wide"])
@pytest.mark.parametrize("value", ["maybe", 2, None])
def test_what_is_no_bool_is_refused_where_one_is_declared(key: str, value: Any, flagged: str):
    allowed = rf"^env\.kwargs\.{key}={value}: {flagged} declares a bool; allowed are true and false$"
    with pytest.raises(ConfigError, match=allowed):
        make_gym(flagged, {key: value})


def test_bools_and_all_other_arguments_pass(flagged: str):
    given = {"flat": True, "name": "maybe", "wide": 0, "late": None}
    with pytest.raises(ConfigError, match="it declares no task"):  # so it was made
        make_gym(flagged, given)


@pytest.fixture
def flagged() -> Iterator[str]:
    gymnasium.register("Flagged-v0", Flagged, max_episode_steps=10)
    yield "Flagged-v0"
    del gymnasium.registry["Flagged-v0"]
