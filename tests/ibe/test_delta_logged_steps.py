"""What a log says about an instructor, of episodes that are short enough to read."""

from __future__ import annotations

import numpy as np
import pytest

from ibe_rl.ibe.delta import LoggedSteps
from ibe_rl.types import Episode


def episode(places: list[float], instruction: list[float | None], rewards: list[float] | None = None) -> Episode:
    """One number moves; None is silence, under which the environment says 0 or what was said last."""
    steps = len(instruction)
    return Episode(
        states=np.array(places, float)[:, None],
        actions=np.zeros(steps, int),
        rewards=np.array([0.0] * steps if rewards is None else rewards),
        instructions=np.array([9.0 if one is None else one for one in instruction])[:, None],
        given=np.array([one is not None for one in instruction]),
        terminated=False,
        success=False,
        context="here" if places[0] == 0 else "there",
    )


TWO = [
    episode([0, 1, 3, 6], [1, None, -1], [1, 10, 100]),
    episode([5, 5, 4], [-1, 0], [2, 4]),
]


def test_each_step_is_the_beginning_of_a_window() -> None:
    record = LoggedSteps.of(TWO, 2)
    assert (len(record), record.episode_count, record.horizon_steps) == (5, 2, 2)
    assert record.states[:, 0].tolist() == [0, 1, 3, 5, 5]
    assert record.next_states[:, 0].tolist() == [1, 3, 6, 5, 4]
    assert record.step.tolist() == [0, 1, 2, 0, 1]
    assert record.episode.tolist() == [0, 0, 0, 1, 1]
    assert record.returns.tolist() == [111, 6]
    assert record.contexts.tolist() == ["here", "there"]


def test_windows_end_with_their_episode() -> None:
    record = LoggedSteps.of(TWO, 2)
    assert record.delta[:, 0].tolist() == [3, 5, 3, -1, -1]
    assert record.window_return.tolist() == [11, 110, 100, 6, 4]
    assert record.complete.tolist() == [True, True, False, True, False]


def test_windows_longer_than_every_episode_are_none_of_them_whole() -> None:
    record = LoggedSteps.of(TWO, 9)
    assert record.delta[:, 0].tolist() == [6, 5, 3, -1, -1]
    assert record.window_return.tolist() == [111, 110, 100, 6, 4]
    assert not record.complete.any()


def test_silence_says_nothing() -> None:
    record = LoggedSteps.of(TWO, 2)
    assert record.given.tolist() == [True, False, True, True, True]
    assert record.instruction[:, 0].tolist() == [1, 0, -1, -1, 0]
    assert record.signs(0).tolist() == [1, 0, -1, -1, 0]


def test_each_number_has_its_own_signs() -> None:
    both = Episode(
        states=np.zeros((3, 1)),
        actions=np.zeros(2, int),
        rewards=np.zeros(2),
        instructions=np.array([[0.5, -3], [-0.1, 0]]),
        given=np.ones(2, bool),
        terminated=False,
        success=False,
        context="here",
    )
    record = LoggedSteps.of([both], 1)
    assert record.signs(0).tolist() == [1, -1]
    assert record.signs(1).tolist() == [-1, 0]


def heard(instruction: list[float | None], horizon_steps: int) -> list[int]:
    steps = LoggedSteps.of([episode([0.0] * (len(instruction) + 1), instruction)], horizon_steps).last_heard(0).tolist()
    assert steps == sorted(steps)
    return steps


def test_an_instructor_who_also_says_0_is_heard_only_when_they_speak() -> None:
    assert heard([1, None, None, 0, None, None], 2) == [0, 3, 3, 3, 4, 5]  # never again: the first step
    assert heard([1, None, None, 0, None, None], 9) == [3, 3, 3, 3, 4, 5]


def test_silence_is_0_for_an_instructor_who_never_says_0() -> None:
    assert heard([1, None, None, -1, None, None], 2) == [2, 3, 4, 5, 5, 5]


def test_nobody_is_heard_in_another_episode() -> None:
    record = LoggedSteps.of([episode([0, 0, 0], [0, None]), episode([0, 0, 0], [None, 1])], 1)
    assert record.last_heard(0).tolist() == [0, 1, 3, 3]


def test_onsets_are_between_two_things_that_were_said_in_one_episode() -> None:
    instruction: list[float | None] = [1, 1, -1, None, 1, 0, 0, 0.5]
    record = LoggedSteps.of([episode([0.0] * 9, instruction), episode([0, 0], [-1])], 1)
    assert record.onsets(0).tolist() == [2, 5, 7]  # not over silence, and not to the next episode


def test_a_louder_word_for_the_same_way_is_no_onset() -> None:
    assert LoggedSteps.of([episode([0, 0, 0], [0.2, 1])], 1).onsets(0).tolist() == []


def test_without_episodes_there_is_no_record() -> None:
    with pytest.raises(ValueError, match="cut_windows needs at least one episode"):
        LoggedSteps.of([], 1)


def test_a_horizon_of_no_step_is_refused() -> None:
    with pytest.raises(ValueError, match="horizon_steps=0: at least 1"):
        LoggedSteps.of(TWO, 0)
