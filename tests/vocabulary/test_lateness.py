"""How late everybody is over the refreshes of a run, and what was said at the steps that it was about."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from by_hand import STEPS, TASK, add, config, obey, stay

from ibe_rl.ibe.delay import Delay, caught_up
from ibe_rl.instructors.taught import told_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Episode
from ibe_rl.view.sentences import worth
from ibe_rl.vocabulary import lateness as module
from ibe_rl.vocabulary.lateness import delays_of, in_words
from ibe_rl.vocabulary.refresh_columns import figures
from ibe_rl.vocabulary.tracker import VocabularyTracker
from ibe_rl.vocabulary.training_episodes import read_training_episodes
from ibe_rl.vocabulary.who_is_late import INSTRUCTOR, TEACHER, of_first

PERSON_SPEAKS, OTHERS = np.tile(np.array(told_of("person"), np.int32), (STEPS, 1)), np.zeros((STEPS, 3), np.int32)
UNKNOWN = Delay(0, 0, 50, known=False)


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> list[Sequence[Episode]]:
    """The episodes in which somebody's delay was looked for; it is as many steps as there were episodes."""
    looked: list[Sequence[Episode]] = []

    def find(episodes: Sequence[Episode]) -> Delay:
        looked.append(episodes)
        return Delay(len(episodes), len(episodes), len(episodes) + 1)

    monkeypatch.setattr(module, "find_delay", find)
    return looked


def test_what_was_said_moves_to_the_steps_that_it_was_about(log: TrajectoryLog):
    obey(log)
    up = log.read([0])[0]
    [moved] = caught_up([up], Delay(5, 4, 6))
    assert moved.instructions[:, 0].tolist() == [1.0] * (STEPS - 5) + [0.0] * 5
    assert moved.given.tolist() == [True] * (STEPS - 5) + [False] * 5
    np.testing.assert_array_equal(moved.states, up.states)
    assert not caught_up([up], Delay(STEPS + 3, 0, 99))[0].given.any()
    assert caught_up([up], None)[0] is caught_up([up], UNKNOWN)[0] is up


@pytest.mark.usefixtures("heard")
def test_everybody_has_a_delay_of_their_own(log: TrajectoryLog):
    for number in range(5):
        add(log, 1.0 + number, 1.0, told=PERSON_SPEAKS if number < 2 else OTHERS)
    add(log, 9.0, 1.0, given=False, told=OTHERS)  # silence is nobody's delay
    delays = delays_of(log, config())
    assert {who: delay.steps for who, delay in delays.items()} == {TEACHER: 2, INSTRUCTOR: 3}
    assert of_first(delays) == delays[TEACHER]
    lessons = read_training_episodes(log, config(), seed=0, delays=delays)
    taught = [one for one in lessons.best if one.total_reward < 2.5]
    assert {int(one.given.sum()) for one in taught[-2:]} == {STEPS - 2}
    assert [int(one.given.sum()) for one in lessons.best if one.total_reward > 2.5] == [STEPS - 3] * 3 + [0]


def test_only_the_newest_are_heard(log: TrajectoryLog, heard: list[Sequence[Episode]], monkeypatch: pytest.MonkeyPatch):
    for reward in range(6):
        add(log, float(reward), 1.0)
    assert delays_of(log, config(newest_frames=2 * STEPS))[INSTRUCTOR].steps == 2
    monkeypatch.setattr(module, "NEWEST_EPISODES", 3)
    delays_of(log, config())
    assert [round(one.total_reward) for one in heard[-1]] == [3, 4, 5]


@pytest.mark.parametrize(
    ("last", "found", "expected"),
    [
        (None, Delay(20, 18, 22), 20),
        (UNKNOWN, Delay(20, 18, 22), 20),
        (Delay(20, 18, 22), Delay(23, 19, 25), 20),  # nearly the same: it stays
        (Delay(20, 10, 26), Delay(26, 22, 28), 23),  # perhaps the same: half way
        (Delay(20, 18, 22), Delay(40, 38, 42), 40),  # another one for sure
        (Delay(27, 26, 32), Delay(25, 24, 26), 26),  # nearly the same, as far as the log allows
        (Delay(4, 3, 6), Delay(0, 0, 3), 0),
        (Delay(0, 0, 1), Delay(3, 2, 4), 0),
        (Delay(20, 18, 22), UNKNOWN, 20),
        (UNKNOWN, UNKNOWN, 0),
    ],
)
def test_a_delay_does_not_jump_unless_it_has_changed(
    log: TrajectoryLog, monkeypatch: pytest.MonkeyPatch, last: Delay | None, found: Delay, expected: int
):
    obey(log)
    monkeypatch.setattr(module, "find_delay", lambda _: found)
    delay = delays_of(log, config(), {} if last is None else {INSTRUCTOR: last})[INSTRUCTOR]
    assert delay.steps == expected
    assert delay.known == (found.known or bool(last and last.known))


def test_a_delay_that_is_set_is_not_looked_for(log: TrajectoryLog, heard: list[Sequence[Episode]]):
    obey(log)
    delays = delays_of(log, config(delay_steps=4))
    assert not heard
    assert delays[TEACHER] == delays[INSTRUCTOR] == Delay(4, 4, 4)


def test_a_refresh_says_it_and_a_resumed_run_remembers(
    log: TrajectoryLog, tmp_path: Path, heard: list[Sequence[Episode]]
):
    obey(log)
    tracker = VocabularyTracker(config(), TASK, seed=0)
    refresh = tracker.refresh(log, stay)
    assert len(heard) == 1
    tracker.settle(log)
    assert len(heard) == 1  # the same episodes
    assert figures(refresh)["ibe/delay_steps"] == 3
    assert "the instructor is about 3 steps behind (3 to 4)" in worth(refresh, TASK)
    tracker.save(tmp_path, refresh)
    saved = json.loads(max(tmp_path.glob("0*.json")).read_text())
    assert (saved["delay_steps"], saved["delay_interval_steps"]) == (3, [3, 4])
    assert saved["delays"] == {INSTRUCTOR: {"steps": 3, "low": 3, "high": 4, "known": True}}
    again = VocabularyTracker(config(), TASK, seed=0)
    again.load_state_dict(tracker.state_dict())
    assert again.delays == tracker.delays


def test_a_refresh_says_that_it_cannot_tell(log: TrajectoryLog, tmp_path: Path):
    obey(log)  # each episode has one instruction only
    tracker = VocabularyTracker(config(), TASK, seed=0)
    refresh = tracker.refresh(log, stay)
    assert np.isnan(figures(refresh)["ibe/delay_steps"])
    assert "how late the instructor is cannot be told" in worth(refresh, TASK)
    tracker.save(tmp_path, refresh)
    saved = json.loads(max(tmp_path.glob("0*.json")).read_text())
    assert saved["delay_steps"] is saved["delay_interval_steps"] is None


def test_delays_in_words():
    assert in_words(TEACHER, Delay(22, 20, 25)) == "you are about 22 steps behind (20 to 25)"
    assert in_words(INSTRUCTOR, Delay(1, 1, 1)) == "the instructor is about 1 step behind"
    assert in_words(TEACHER, Delay(0, 0, 2)) == "you are not late"
    assert in_words(TEACHER, UNKNOWN) == "how late you are cannot be told"


def test_it_is_searched_at_each_refresh_for_a_person_and_else_when_episodes_have_doubled(
    log: TrajectoryLog, heard: list[Sequence[Episode]]
):
    program, person = (VocabularyTracker(config(), TASK, seed=0) for _ in range(2))
    searched = []
    for number in range(1, 9):
        add(log, float(number), 1.0)
        before = len(heard)
        program._hear(log)
        searched += [number] * (len(heard) > before)
    assert searched == [1, 2, 4, 8]
    taken_up = VocabularyTracker(config(), TASK, seed=0)
    taken_up.load_state_dict(program.state_dict())
    before = len(heard)
    taken_up._hear(log)
    assert len(heard) == before
    person._hear(log)  # before anybody teaches
    assert set(person.delays) == {INSTRUCTOR}
    for _ in range(2):
        add(log, 9.0, 1.0, told=PERSON_SPEAKS)
        before = len(heard)
        person._hear(log)
        assert len(heard) > before
    assert TEACHER in person.delays
