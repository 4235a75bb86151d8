"""What a person said, as a log holds it, and the habits that are cloned from it."""

from pathlib import Path

import numpy as np
import pytest
from by_hand import STEPS, TASK, add

from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.instructors import check_instructor, make_instructor, make_stand_in, named_instructor
from ibe_rl.instructors.habits import HabitsConfig
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.instructors.taught import taught_episodes, taught_rows, told_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, ConfigError

EVERYBODY, SEEN = np.ones(2, bool), np.array([[0, -1, 0], [0, 1, 0]], np.float32)


def told(*by: str, marks: dict[int, tuple[int, int]] | None = None) -> Array:
    """Of an episode of ``STEPS``, each speaker equally long."""
    who = np.repeat(by, STEPS // len(by))
    return np.array([told_of(one, (marks or {}).get(step, (0, 0))) for step, one in enumerate(who)], np.int32)


OTHERS = np.zeros((STEPS, 3), np.int32)


@pytest.fixture
def log(tmp_path: Path) -> TrajectoryLog:
    return TrajectoryLog(tmp_path / "trajectories", 10_000, TASK.contexts)


def test_only_what_the_person_said_is_theirs(log: TrajectoryLog):
    add(log, 1.0, 1.0, told=OTHERS)
    add(log, 1.0, 1.0, told=told("person", "oracle", "held", "nobody"))
    assert taught_rows(log).tolist() == [1]
    [episode], marked = taught_episodes(log, [1])
    assert (episode.given.tolist(), marked) == ([True] * 3 + [False] * 3 + [True] * 3 + [False] * 3, 0)


def test_a_log_in_which_nobody_taught_has_no_such_episodes(log: TrajectoryLog):
    assert taught_rows(log).tolist() == []
    add(log, 1.0, 1.0)
    assert taught_rows(log).tolist() == []


def test_what_was_said_during_a_movement_called_wrong_does_not_count(log: TrajectoryLog):
    """Also where that is heard in the next episode, and with episodes of others in between."""
    add(log, 1.0, 1.0, told=told("person", marks={11: (1, 3)}))
    add(log, 1.0, 1.0, told=OTHERS)
    add(log, 1.0, 1.0, told=told("person", marks={0: (2, 11), 1: (2, 3)}))
    first, second = taught_episodes(log, [0, 2], horizon_steps=4)[0]
    assert np.flatnonzero(~first.given).tolist() == [1, 2, 3, 4, 5, 9, 10, 11]
    assert second.given.all()
    assert taught_episodes(log, [0, 2])[1] == 2
    assert np.flatnonzero(~taught_episodes(log, [2], 4)[0][0].given).tolist() == []


def test_a_mark_of_an_episode_that_is_no_longer_there_is_forgotten(log: TrajectoryLog):
    add(log, 1.0, 1.0, told=told("person", marks={0: (2, 5)}))
    assert taught_episodes(log, [0], 4)[1] == 0


def test_the_log_keeps_it_on_disk_and_goes_on_with_it(log: TrajectoryLog):
    add(log, 1.0, 1.0, told=told("person"))
    log.flush()
    assert taught_rows(TrajectoryLog.open(log.folder)).tolist() == [0]


def says(instructor: object) -> list[list[float]]:
    instruction, given = instructor.instruct(SEEN, EVERYBODY)
    return np.hstack([instruction, given]).tolist()


def teach(log: TrajectoryLog, episodes: int = 20) -> None:
    """The opposite of the rule: down when it rises, up when it falls."""
    for number in range(episodes):
        up = 1.0 if number % 2 else -1.0
        add(log, 1.0, -up, went=up, told=told("person"))
        add(log, 1.0, up, told=OTHERS)


@pytest.mark.parametrize("others", ["habits", "oracle"])
def test_in_evaluations_the_persons_habits_instruct_as_soon_as_there_are_some(log: TrajectoryLog, others: str):
    instructor = make_stand_in(HumanConfig(others=others), TASK, 0, log)
    instructor.reset(EVERYBODY)
    before = {"habits": [[0, 0], [0, 0]], "oracle": [[-1, 1], [1, 1]]}[others]
    instead = {"habits": "silent", "oracle": "oracle"}[others]
    assert (says(instructor), named_instructor(instructor)) == (
        before,
        f"the person has said nothing yet; {instead} instead",
    )
    teach(log)
    instructor.reset(EVERYBODY)
    assert says(instructor) == [[1, 1], [-1, 1]]
    assert named_instructor(instructor) == "the habits of the person who taught, from 20 of their episodes"


def test_what_the_oracle_said_is_not_a_habit_of_the_person(log: TrajectoryLog):
    for _ in range(20):
        add(log, 1.0, 1.0, told=told("oracle"))
    assert "said nothing yet" in (named_instructor(make_stand_in(HumanConfig(), TASK, 0, log)) or "")


def test_the_habits_of_a_run_can_teach_another_one(log: TrajectoryLog, tmp_path: Path):
    collect = CollectConfig()
    with pytest.raises(ConfigError, match=r"^instructor\.run=.*; allowed is a run that a person taught"):
        check_instructor(HabitsConfig(run=str(tmp_path)), collect, TASK)
    add(log, 1.0, 1.0)
    log.flush()
    with pytest.raises(ConfigError, match=r"^instructor\.run=.*: nobody taught it; allowed is"):
        check_instructor(HabitsConfig(run=str(tmp_path)), collect, TASK)
    teach(log)
    log.flush()
    check_instructor(HabitsConfig(run=str(tmp_path)), collect, TASK)
    for instructor in (
        make_instructor(HabitsConfig(run=str(tmp_path)), TASK),
        make_stand_in(HabitsConfig(run=str(tmp_path)), TASK, 0, TrajectoryLog(tmp_path / "new", 1_000, TASK.contexts)),
    ):
        instructor.reset(EVERYBODY)
        assert says(instructor) == [[1, 1], [-1, 1]]


def test_a_run_whose_log_is_gone_has_no_habits(tmp_path: Path):
    instructor = make_instructor(HabitsConfig(run=str(tmp_path), otherwise="oracle"), TASK)
    instructor.reset(EVERYBODY)
    assert says(instructor) == [[-1, 1], [1, 1]]


def test_an_instructor_without_a_person_is_nobodys(log: TrajectoryLog):
    assert named_instructor(make_stand_in(InstructorConfig("oracle"), TASK, 0, log)) is None
