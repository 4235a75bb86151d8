"""The state of recorded observations, by the function that the environment declares."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from walker import walker, walker_config

from ibe_rl.apps.datasets.importing import declared_state
from ibe_rl.apps.datasets.recorded import DATASET_PERCEPT, RawEpisode
from ibe_rl.types import ConfigError

SEEN: Any = {"goal": np.zeros(1), "here": np.array([0.5, -1.0]), "way": 1}


def recorded(observations: Any, **infos: Any) -> RawEpisode:
    return RawEpisode("dataset=walks-v0, episode 0", observations, (), (), (), (), infos)


def state_of(obs: str, first: RawEpisode, **changes: Any) -> Any:
    config = walker_config(obs, **changes)
    return declared_state(walker(obs, **changes), config, first)


def test_the_environment_says_how_to_read_an_observation() -> None:
    state = state_of("dict", recorded(SEEN), state="walker:only_seen")
    np.testing.assert_array_equal(state(SEEN), np.array([0.5, -1.0], np.float32))


def test_what_is_a_state_already_is_read_as_it_is() -> None:
    rows = np.zeros((31, 2))
    assert state_of("box", recorded(rows)) is None
    assert state_of("dict", recorded(rows)) is None
    assert state_of("dict", recorded(np.zeros((31, 4)))) is None  # with the instruction and whether it was given
    assert state_of("dict", recorded(SEEN, **{DATASET_PERCEPT: np.zeros((31, 5))})) is None  # exported from a run


@pytest.mark.parametrize(
    ("function", "why"),
    [
        ("place_and_speed", "it reads the environment, which a dataset does not have"),
        ("only_seen", "it raised KeyError: 'here' for a recorded observation"),
    ],
)
def test_a_function_that_needs_more_than_the_observation_is_refused(function: str, why: str) -> None:
    observation = SEEN if function == "place_and_speed" else {"goal": np.zeros(1)}
    state = state_of("dict", recorded(SEEN), state=f"walker:{function}")
    with pytest.raises(ConfigError, match=rf"^env\.task\.state: {why}; allowed is .*--state=MODULE:NAME"):
        state(observation)
