"""RawEpisode episodes are converted where that changes nothing, else refused in a line with episode and step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bead import BEAD_TASK, to_zero
from gymnasium.spaces import Box, Discrete
from numpy.testing import assert_array_equal

from ibe_rl.apps.datasets.instruction_source import InstructionSource, values_of_words
from ibe_rl.apps.datasets.recorded import Conversion, RawEpisode
from ibe_rl.envs import LANDER_TASK
from ibe_rl.types import ConfigError

STEPS = 6
THREE: Any = Discrete(3)
STATES = np.column_stack([np.linspace(1, 0.1, STEPS + 1), np.full(STEPS + 1, -0.1)])
LAST = np.arange(STEPS) == STEPS - 1


def recorded(**changes: Any) -> RawEpisode:
    one = RawEpisode("dataset=some, episode 4", STATES, np.ones(STEPS, int), np.arange(6.0), LAST, LAST & False)
    return replace(one, **changes)


def converted(one: RawEpisode, source: str | None = "rule", actions: Any = THREE, **more: Any) -> Any:
    return Conversion(BEAD_TASK, actions, InstructionSource(BEAD_TASK, source), **more)(one)


def test_an_episode_comes_in_as_it_was() -> None:
    episode = converted(recorded())
    assert_array_equal(episode.states, STATES.astype(np.float32))
    assert_array_equal(episode.instructions, to_zero(STATES[:-1].astype(np.float32)))
    assert (episode.terminated, episode.success, episode.context, episode.total_reward) == (True, False, "any", 15)
    assert episode.given.all()


def test_what_changes_nothing_is_converted() -> None:
    column = converted(recorded(rewards=np.arange(6)[:, None], actions=np.ones((6, 1)), truncations=LAST[:, None]))
    assert_array_equal(column.rewards, np.arange(6, dtype=np.float32))
    assert column.actions.tolist() == [1] * 6
    assert converted(recorded(observations=STATES.tolist())).states.dtype == np.float32
    assert converted(recorded(terminations=LAST.astype(int))).terminated


def with_value(array: Any, at: Any, value: Any) -> Any:
    changed = np.array(array, dtype=float)
    changed[at] = value
    return changed


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"observations": STATES[:-1]}, "it has 6 observations for 6 actions; allowed are 7: the state after the last"),
        ({"observations": STATES[:, :1]}, r"observations have the shape \(7, 1\); allowed is \(7, 2\), the state, or"),
        ({"observations": with_value(STATES, (3, 1), np.nan)}, r"observations of step 3 are \[.*nan\]; .* finite"),
        ({"observations": {"a": STATES}}, "observations have the keys a; allowed is a row of numbers, or --state"),
        ({"observations": (STATES, STATES)}, "observations have 2 parts; allowed"),
        ({"observations": np.full(7, "x")}, "observations are of type <U1; allowed are numbers of the same count"),
        ({"observations": [[1, 2], [3]]}, "observations are of type object; allowed are numbers"),
        ({"rewards": with_value(LAST, 2, -np.inf)}, "rewards of step 2 are -inf; allowed are finite numbers"),
        ({"rewards": np.ones((6, 2))}, r"rewards have the shape \(6, 2\); allowed is one number a step"),
        ({"rewards": np.ones(0)}, r"rewards have the shape \(0,\); allowed is one number a step, and at least one"),
        ({"rewards": np.full(6, None)}, "rewards are of type object; allowed are numbers"),
        ({"actions": np.array([0, 1, 2, 3, 0, 0])}, r"step 3 has 3; allowed are 6 actions of Discrete\(3\)"),
        ({"actions": np.full(6, 0.5)}, r"step 0 has 0.5; allowed are 6 actions of Discrete\(3\)"),
        ({"actions": np.ones(5, int)}, r"actions have the shape \(5,\); allowed are 6 actions"),
        ({"terminations": LAST[:-1]}, "terminations are 5 of type bool; allowed are 6 bools"),
        ({"truncations": np.full(6, "no")}, "truncations are 6 of type <U2; allowed are 6 bools"),
        ({"terminations": LAST[::-1]}, "it goes on after its end at step 0; allowed is one end, the last step"),
        ({"infos": {"success": np.full(7, 0.3)}}, r"infos\['success'\] ends with \[0.3\]; allowed is a bool"),
        ({"infos": {"success": np.array(["yes"])}}, r"infos\['success'\] ends with \['yes'\]; allowed is a bool"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_episode(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigError, match=rf"^dataset=some, episode 4: .*{line}"):
        converted(recorded(**changes))


def test_actions_outside_their_bounds_are_refused() -> None:
    box: Any = Box(-1, 1, (1,))
    line = r"step 2 has the action \[1.5\]; allowed is Box"
    with pytest.raises(ConfigError, match=line):
        converted(recorded(actions=with_value(np.zeros((6, 1)), 2, 1.5)), actions=box)
    assert converted(recorded(actions=np.full((6, 1), 1.00001)), actions=box).actions.shape == (6, 1)


def test_episodes_longer_than_the_environments_and_unknown_contexts_are_refused() -> None:
    long = {"observations": np.zeros((32, 2)), "actions": np.zeros(31, int), "rewards": np.zeros(31)}
    flags = np.zeros(31, bool)
    with pytest.raises(ConfigError, match=r"it has 31 steps; allowed are at most 30 \(the environment's\)"):
        converted(recorded(**long, terminations=flags, truncations=flags))
    elsewhere = replace(BEAD_TASK, context=lambda _: "moon")
    with pytest.raises(ConfigError, match="its context is 'moon'; allowed is one of any"):
        Conversion(elsewhere, THREE, InstructionSource(elsewhere, "rule"))(recorded())


def test_success_is_that_of_the_infos_or_of_the_tasks_own_function() -> None:
    assert converted(recorded(infos={"success": np.arange(7) == 6})).success
    assert converted(recorded(infos={"success": np.array([[1.0]])})).success
    assert converted(recorded(), succeeded=lambda state, *ends: state[0] < 0.2 and ends == (True, False)).success
    counting = Conversion(BEAD_TASK, THREE, InstructionSource(BEAD_TASK, "rule"))
    assert not counting(recorded(terminations=LAST & False, seed=8)).success
    assert (counting.without_success, counting.without_end, counting.seeds) == (1, 1, [8])


def test_a_function_of_one_observation_makes_the_state() -> None:
    parts = {"place": STATES[:, 0], "more": (STATES[:, 1], np.zeros((7, 4, 4)))}

    def state(one: Any) -> Any:
        assert one["more"][1].shape == (4, 4)
        return [one["place"], one["more"][0]]

    episode = converted(recorded(observations=parts), state=state)
    assert_array_equal(episode.states, STATES.astype(np.float32))
    with pytest.raises(ConfigError, match=r"observations have the shape \(7, 1\); allowed is \(7, 2\), the state$"):
        converted(recorded(observations=parts), state=lambda one: [one["place"]])
    with pytest.raises(ConfigError, match="function of --state raised KeyError: 'goal'; allowed is one observation to"):
        converted(recorded(observations=parts), state=lambda one: one["goal"])


def heard(said: Any, key: str | None = "instruction", **infos: Any) -> Any:
    return converted(recorded(infos={"instruction": np.array(said), **infos}), key)


def test_numbers_and_words_are_heard() -> None:
    assert heard([1, 1, 0, 0, -1, -1]).instructions[:, 0].tolist() == [1, 1, 0, 0, -1, -1]
    assert heard([[1.0]] * 7, instruction_given=np.arange(7) % 2).given.tolist() == [False, True] * 3
    assert values_of_words(BEAD_TASK) == {"staying": (0,), "going left": (-1,), "going right": (1,)}
    said = heard(["going left", "Staying ", "", "none", "going right", "going right"])
    assert said.instructions[:, 0].tolist() == [-1, 0, 0, 0, 1, 1]
    assert said.given.tolist() == [True, True, False, False, True, True]
    assert heard(np.array([b"going left"] * 7)).instructions[:, 0].tolist() == [-1] * 6
    assert len(values_of_words(LANDER_TASK)) == len(LANDER_TASK.instruction_values)


@pytest.mark.parametrize(
    ("said", "line"),
    [
        (["left"] * 7, r"infos\['instruction'\] of step 0 is 'left'; allowed are staying, going left, going right"),
        ([1.0] * 4, r"infos\['instruction'\] has the shape \(4, 1\) in an episode of 6 steps; allowed is \(6, 1\), or"),
        ([], r"has the shape \(0,\) in an episode of 6 steps"),
        ([1, 1, np.nan, 0, 0, 0], r"ranges from nan to nan; allowed are numbers from -1 to 1"),
        ([1j] * 6, r"infos\['instruction'\] is of type complex128; allowed are numbers or words"),
    ],
)
def test_what_nobody_understands_is_refused(said: Any, line: str) -> None:
    with pytest.raises(ConfigError, match=line):
        heard(said)


def test_two_instructors_are_not_mixed() -> None:
    with pytest.raises(
        ConfigError, match=r"it has no infos\['instruction'\], as the first episode has; .* --instruction rule"
    ):
        converted(recorded(), "instruction")
    for source in ("rule", None):
        with pytest.raises(
            ConfigError, match=r"it has infos\['instruction'\] and the first episode has none; allowed is"
        ):
            heard([0] * 6, source)
    asked = InstructionSource(BEAD_TASK, "rule", asked=True)
    one = Conversion(BEAD_TASK, THREE, asked)(recorded(infos={"instruction": np.zeros(6)}))
    assert_array_equal(one.instructions, to_zero(STATES[:-1].astype(np.float32)))
    with pytest.raises(
        ConfigError, match=r"infos\['instruction_given'\] has 3 values of type int64; allowed are 6 bools"
    ):
        heard([0] * 6, instruction_given=np.ones(3, int))


def test_the_first_episode_tells_where_the_instruction_is() -> None:
    whole = np.column_stack([STATES, np.ones((7, 2))])
    for key, one, expected in (
        (None, recorded(infos={"instruction": np.zeros(6)}), "instruction"),
        (None, recorded(observations=whole), None),
        (None, recorded(), "rule"),
        (None, recorded(observations={"a": STATES}), "rule"),
        ("command", recorded(infos={"command": np.zeros(6)}), "command"),
        ("rule", recorded(observations=whole), "rule"),
    ):
        assert InstructionSource.found(BEAD_TASK, key, one, whole=True).source == expected
    episode = converted(recorded(observations=whole), None)
    assert_array_equal(episode.instructions, np.ones((6, 1)))
    with pytest.raises(ConfigError, match="instruction=other: allowed are no keys of its infos, or rule"):
        InstructionSource.found(BEAD_TASK, "other", recorded(), whole=True)
