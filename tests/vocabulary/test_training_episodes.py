"""Which episodes and windows of a log made by hand a vocabulary is learnt from, and how far ahead it looks."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import STEPS, TASK, add, better_half, config, two_floors

from ibe_rl.ibe import TooLittleDataError
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Episode
from ibe_rl.vocabulary import training_episodes as module
from ibe_rl.vocabulary.settled_horizon import horizon_of
from ibe_rl.vocabulary.training_episodes import (
    best_windows,
    find_steps,
    instructed_windows,
    read_training_episodes,
    settled,
)


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return two_floors(tmp_path / "log")


def rewards(episodes: Any) -> list[int]:
    return sorted(round(episode.total_reward) for episode in episodes)


def test_the_best_are_apart_from_the_others(log: TrajectoryLog):
    lessons = read_training_episodes(log, better_half(), seed=0)
    assert (lessons.logged, lessons.counted) == (8, 8)
    assert [round(episode.total_reward) for episode in lessons.best] == [100, 99, 98, 97]  # oldest first
    assert rewards(lessons.others) == [47, 48, 49, 50]


def test_the_best_can_be_those_of_each_context(log: TrajectoryLog):
    lessons = read_training_episodes(log, better_half(top_within="context"), seed=0)
    assert rewards(lessons.best) == [49, 50, 99, 100]
    assert rewards(lessons.others) == [47, 48, 97, 98]


def test_the_instructor_is_heard_in_good_and_bad_episodes_as_they_are(log: TrajectoryLog, monkeypatch: Any):
    assert rewards(read_training_episodes(log, better_half(), seed=0).heard) == [47, 48, 49, 50, 97, 98, 99, 100]
    monkeypatch.setattr(module, "OTHER_EPISODES", 2)  # of four: so two of the four best too
    heard = rewards(read_training_episodes(log, better_half(), seed=0).heard)
    assert len(heard) == 4
    assert sum(reward > 60 for reward in heard) == 2
    monkeypatch.setattr(module, "OTHER_EPISODES", 3)  # of six: so one of the two best
    heard = rewards(read_training_episodes(log, better_half(top_fraction=0.25), seed=0).heard)
    assert len(heard) == 4
    assert sum(reward > 98 for reward in heard) == 1
    assert rewards(read_training_episodes(log, config(), seed=0).heard) == [
        47,
        48,
        49,
        50,
        97,
        98,
        99,
        100,
    ]  # all are best
    monkeypatch.setattr(module, "OTHER_EPISODES", 7)
    one = rewards(read_training_episodes(log, better_half(top_fraction=0.1), seed=0).heard)
    assert one == [47, 48, 49, 50, 97, 98, 99, 100]  # at least one of the best


@pytest.mark.parametrize(
    ("newest_frames", "counted"), [(None, 8), (96, 8), (85, 8), (84, 7), (48, 4), (37, 4), (36, 3), (25, 3)]
)
def test_only_what_ended_in_the_newest_frames_counts(log: TrajectoryLog, newest_frames: int | None, counted: int):
    """Eight episodes of twelve frames ended at frame 12, 24, ... 96; the newest 84 frames are 13 to 96."""
    lessons = read_training_episodes(log, better_half(newest_frames=newest_frames), seed=0)
    assert (lessons.logged, lessons.counted) == (8, counted)
    assert len(lessons.best) == np.ceil(counted / 2)
    assert len(lessons.others) == counted - len(lessons.best)


def test_if_nothing_ended_lately_nothing_is_learnt(log: TrajectoryLog):
    log.frames += 100  # an episode that has not ended
    with pytest.raises(TooLittleDataError, match="no episode has ended in the newest 100 frames"):
        read_training_episodes(log, config(newest_frames=100), seed=0)
    assert read_training_episodes(log, config(newest_frames=101), seed=0).counted == 1


def test_without_an_episode_nothing_is_learnt(tmp_path: Path):
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        read_training_episodes(TrajectoryLog(tmp_path, 1_000, TASK.contexts), config(), seed=0)


def test_the_others_are_a_sample(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "OTHER_EPISODES", 1)
    drawn = [rewards(read_training_episodes(log, better_half(), seed).others) for seed in (0, 0, *range(1, 6))]
    assert drawn[0] == drawn[1]
    assert len(drawn[0]) == 1
    assert len({tuple(each) for each in drawn}) > 1
    assert read_training_episodes(log, config(), seed=0).others == []


def test_windows_without_an_instruction_are_not_learnt_from(log: TrajectoryLog):
    add(log, 1000, 1.0, given=False)  # the best of all
    lessons = read_training_episodes(log, better_half(), seed=0)
    windows = best_windows(lessons.best, better_half(), 5)
    assert (lessons.logged, len(lessons.best)) == (9, 5)
    assert windows.given.all()
    assert len(windows) == 4 * (STEPS + 1 - 5)


def flight(terminated: bool, success: bool, steps: int = 10) -> Episode:
    states = np.column_stack([np.arange(steps + 1.0), np.zeros((steps + 1, 2))])
    instruction, given = np.ones((steps, 1)), np.ones(steps, bool)
    return Episode(states, np.zeros(steps), np.zeros(steps), instruction, given, terminated, success, "lower")


CRASHED, ARRIVED, CUT_OFF = flight(True, False), flight(True, True), flight(False, False)


@pytest.mark.parametrize(("end", "whole"), [("clamp", 10), ("drop", 7)])
def test_only_windows_that_reach_the_end_of_an_episode_gone_wrong_are_left_out(end: str, whole: int):
    """Of ten steps those that begin at 0 to 5 end, four steps on, before the last state."""
    episodes = [CRASHED, ARRIVED, CUT_OFF]
    kept = instructed_windows(episodes, config(window_end=end), 4)
    assert kept is not None
    assert np.bincount(kept.episode).tolist() == [whole] * 3
    dropped = instructed_windows(episodes, config(window_end=end, failed_ends="drop"), 4)
    assert dropped is not None
    assert dropped.step[dropped.episode == 0].tolist() == [0, 1, 2, 3, 4, 5]
    for other in (1, 2):
        assert dropped.step[dropped.episode == other].tolist() == list(range(whole))


def test_if_nothing_but_failed_ends_is_left_it_is_too_little():
    settings = config(window_end="clamp", failed_ends="drop")
    with pytest.raises(
        TooLittleDataError, match=r"the best 1 episodes have no window of 10 .*the longest has 10 steps"
    ):
        best_windows([CRASHED], settings, 10)
    assert len(best_windows([CRASHED], settings, 9)) == 1


def test_without_episodes_there_is_no_window():
    assert instructed_windows([], config(), 5) is None
    with pytest.raises(TooLittleDataError, match="the best 0 episodes have no window of 5 steps"):
        best_windows([], config(), 5)


def test_too_short_episodes_are_too_little(log: TrajectoryLog):
    best = read_training_episodes(log, better_half(), seed=0).best
    with pytest.raises(
        TooLittleDataError, match=r"the best 4 episodes have no window of 20 .*the longest has 12 steps"
    ):
        best_windows(best, better_half(), 20)


def test_silence_is_too_little(tmp_path: Path):
    silent = TrajectoryLog(tmp_path, 1_000, TASK.contexts)
    for instruction in (1.0, -1.0, 0.0):
        add(silent, 1, instruction, given=False)
    with pytest.raises(TooLittleDataError, match="have no window of 5 steps with an instruction"):
        best_windows(read_training_episodes(silent, config(), seed=0).best, config(), 5)


def test_only_what_was_said_is_heard(log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch):
    add(log, 1000, 1.0, given=False)
    episodes = log.read(range(9))
    states, instruction = module.instructed_states(episodes, 0)
    assert states.shape == (8 * STEPS, 3)
    assert instruction.shape == (8 * STEPS, 1)
    assert np.bincount(instruction[:, 0].astype(int) + 1).tolist() == [2 * STEPS, 4 * STEPS, 2 * STEPS]
    np.testing.assert_array_equal(states[:, 1], instruction[:, 0])  # the speed is as told: rows belong together
    monkeypatch.setattr(module, "HEARD_STATES", 10)
    assert len(module.instructed_states(episodes, 0)[0]) == 10


def test_what_was_found_stands_and_spans_that_are_not_shorter_are_left_out():
    found = settled(config(horizon_steps=None, spans_steps=[3, 12, 20]), 12)
    assert (found.horizon_steps, found.spans_steps) == (12, [3])
    assert settled(found, 40) is found
    set_by_hand = config(horizon_steps=5, spans_steps=[9])
    assert settled(set_by_hand, 12) is set_by_hand


def test_a_horizon_that_has_not_been_found_is_asked_for_by_nobody():
    assert horizon_of(config(horizon_steps=7)) == 7
    with pytest.raises(ValueError, match=r"mapping\.horizon_steps=null: it has not been found yet"):
        horizon_of(config(horizon_steps=None))


def swinging(folder: Path, episodes: int = 20, instruction: Any = None) -> TrajectoryLog:
    """A lift that goes up and down again every 40 steps, told to go to where it will be; its floor jumps about."""
    made, random = TrajectoryLog(folder, 10_000, TASK.contexts), np.random.default_rng(0)
    for _ in range(episodes):
        height = np.sin(2 * np.pi * (np.arange(201) / 40 + random.random()))
        states = np.column_stack([height, np.full(201, 3.0), random.normal(size=201)]).astype(np.float32)
        towards = -np.sign(np.round(states[:-1, :1]))
        said = towards if instruction is None else np.full((200, 1), instruction, np.float32)
        whole = Episode(states, np.zeros(200, int), np.ones(200), said, np.ones(200, bool), True, True, "lower")
        made.add(whole.as_steps(), lambda _: "lower")
    return made


def test_the_horizon_is_found_on_the_axis_on_which_the_words_turn(tmp_path: Path):
    """11 or 12 of 40 steps, of which an instruction stands 13, so that 7 are left at the median moment.

    Where all that changes counted, the noise would say 5.
    """
    log = swinging(tmp_path / "swing")
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == 7
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == find_steps(log, config(horizon_steps=None), TASK, 0)
    assert find_steps(log, config(horizon_steps=9), TASK, 0) == 9


def test_only_the_dimensions_that_count_are_looked_at(tmp_path: Path):
    log = swinging(tmp_path / "swing")
    assert find_steps(log, config(horizon_steps=None, dimensions=["height", "speed"]), TASK, 0) == 7
    assert find_steps(log, config(horizon_steps=None, dimensions=["floor"]), TASK, 0) == 5  # no word turns on it


@pytest.mark.parametrize("instructions", [0.0, 1.0])
def test_where_one_thing_only_is_said_the_leading_change_counts(tmp_path: Path, instructions: float):
    log = swinging(tmp_path / "swing", instruction=instructions)
    assert find_steps(log, config(horizon_steps=None, dimensions=["height"]), TASK, 0) in (11, 12)


def test_in_silence_too(tmp_path: Path):
    log = TrajectoryLog(tmp_path / "silent", 1_000, TASK.contexts)
    add(log, 1.0, 1.0, given=False)
    assert find_steps(log, config(horizon_steps=None), TASK, 0) == 5


def test_without_an_episode_no_horizon_is_found(tmp_path: Path):
    with pytest.raises(TooLittleDataError, match="no episode has ended yet"):
        find_steps(TrajectoryLog(tmp_path / "empty", 1_000, TASK.contexts), config(horizon_steps=None), TASK, 0)
