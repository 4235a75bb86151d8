"""Answers of one moment are one write to disk; none is confirmed before it, and no bad one spoils another."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from own_study import write_study

from ibe_rl.apps.study.answers import FILE, Answer, Answers, Person
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.joint_writer import JointWriter
from ibe_rl.apps.study.messages import BadAnswerError
from ibe_rl.apps.study.sitting import enter

AGREES = Answer("consent", 1, {"agrees": True}, 1000, 0)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[tuple[Study, Answers]]:
    study = open_study(write_study(tmp_path / "study"))
    answers = Answers(tmp_path / FILE)
    yield study, answers
    answers.close()


def taken(desk: tuple[Study, Answers], given: Sequence[tuple[Person, Answer]]) -> list[Any]:
    """What becomes of answers that arrive in the same moment."""

    async def all_at_once() -> list[Any]:
        writer = JointWriter(*desk)
        return await asyncio.gather(*(writer.take(*one) for one in given), return_exceptions=True)

    return asyncio.run(all_at_once())


def kept(desk: tuple[Study, Answers], person: Person) -> list[Answer]:
    return desk[1].answers_of(person)


def test_one_commit_for_all_of_a_moment(desk: tuple[Study, Answers]) -> None:
    people, said = [enter(*desk) for _ in range(5)], list[str]()
    desk[1]._store.set_trace_callback(said.append)
    assert taken(desk, [(person, AGREES) for person in people]) == ["taken"] * 5
    assert said.count("COMMIT") == 1
    assert [kept(desk, person) for person in people] == [[AGREES]] * 5


def test_the_same_answer_twice_in_a_moment_counts_once(desk: tuple[Study, Answers]) -> None:
    person = enter(*desk)
    assert taken(desk, [(person, AGREES), (person, AGREES)]) == ["taken", "answered before"]
    assert kept(desk, person) == [AGREES]


def test_a_bad_answer_spoils_no_other(desk: tuple[Study, Answers]) -> None:
    first, bad, last = (enter(*desk) for _ in range(3))
    wrong = Answer("debriefing", 1, {}, 0, 0)
    became = taken(desk, [(first, AGREES), (bad, wrong), (last, AGREES)])
    assert (became[0], type(became[1]), became[2]) == ("taken", BadAnswerError, "taken")
    assert (kept(desk, first), kept(desk, bad), kept(desk, last)) == ([AGREES], [], [AGREES])


def test_a_failure_inside_spoils_no_other(desk: tuple[Study, Answers]) -> None:
    first, last = enter(*desk), enter(*desk)
    unwritable = Answer("consent", 1, {"agrees": True}, 2**63, 0)  # too large for the file
    became = taken(desk, [(first, unwritable), (last, AGREES)])
    assert (type(became[0]), became[1]) == (OverflowError, "taken")
    assert (kept(desk, first), kept(desk, last)) == ([], [AGREES])


def test_what_is_not_on_disk_is_not_confirmed(desk: tuple[Study, Answers]) -> None:
    people = [enter(*desk) for _ in range(2)]
    desk[1]._store.execute("CREATE TABLE late (one INTEGER REFERENCES people(number) DEFERRABLE INITIALLY DEFERRED)")
    trigger = "CREATE TRIGGER fails AFTER INSERT ON answers BEGIN INSERT INTO late VALUES (-1); END"
    desk[1]._store.execute(trigger)  # such a transaction fails only when it is committed
    became = taken(desk, [(person, AGREES) for person in people])
    assert [type(one) for one in became] == [sqlite3.IntegrityError] * 2
    assert [kept(desk, person) for person in people] == [[], []]
    desk[1]._store.execute("DROP TRIGGER fails")
    assert taken(desk, [(person, AGREES) for person in people]) == ["taken"] * 2


def test_who_withdrew_while_the_answer_was_on_its_way_leaves_nothing(desk: tuple[Study, Answers]) -> None:
    person = enter(*desk)
    desk[1].withdraw(person)
    [became] = taken(desk, [(person, AGREES)])
    assert isinstance(became, BadAnswerError)
    assert kept(desk, person) == []
