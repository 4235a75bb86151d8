"""A person's way through a study, and that an answer counts once, at its page, and in its order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from own_study import right_value, write_study

from ibe_rl.apps.study.answers import FILE, Answer, Answers, Person
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.messages import BadAnswerError
from ibe_rl.apps.study.sitting import ANSWER_TAKEN, ANSWERED_BEFORE, FullError, enter, lay_out, position, take

Desk = tuple[Study, Answers]


@pytest.fixture
def desk(tmp_path: Path):
    study = open_study(write_study(tmp_path / "study"))
    answers = Answers(tmp_path / FILE)
    yield study, answers
    answers.close()


def give(desk: Desk, person: Person, **value: Any) -> str:
    """Answer the page where the person is, with these values or ones that fit."""
    at = position(*desk, person)
    assert at.page is not None
    values = value or right_value(desk[0], at.page)
    return take(*desk, person, Answer(at.page.name, at.attempt, values, 1000, 0))


def now(desk: Desk, person: Person) -> Person:
    known = desk[1].person(person.token)
    assert known is not None
    return known


def test_from_consent_to_the_end(desk: Desk) -> None:
    person, seen = enter(*desk), []
    while (at := position(*desk, now(desk, person))).page:
        seen.append(at.page.kind)
        assert at.done == len(seen) - 1
        assert give(desk, person) == ANSWER_TAKEN
    assert seen[:5] == ["consent", "demographics", "instructions", "comprehension", "trial"]
    assert sorted(seen[5:8]) == ["attention", "trial", "trial"]
    assert seen[8:] == ["scale", "comment", "debriefing"]
    assert now(desk, person).ended == position(*desk, now(desk, person)).ended == "finished"


def test_who_refuses_is_out(desk: Desk) -> None:
    person = enter(*desk)
    give(desk, person, agrees=False)
    at = position(*desk, now(desk, person))
    assert (at.page, at.ended) == (None, "no_consent")
    with pytest.raises(BadAnswerError, match="the page to answer is none"):
        take(*desk, now(desk, person), Answer("demographics", 1, {"choices": [None, None]}, 1, 0))


def to_comprehension(desk: Desk) -> Person:
    person = enter(*desk)
    for _ in range(3):
        give(desk, person)
    return person


def test_a_check_that_was_not_passed_is_tried_again_after_the_instructions(desk: Desk) -> None:
    person = to_comprehension(desk)
    give(desk, person, choices=[0])
    at = position(*desk, person)
    assert at.page is not None
    assert (at.page.name, at.attempt) == ("instructions", 2)
    give(desk, person)
    give(desk, person, choices=[1])
    assert position(*desk, now(desk, person)).page.kind == "trial"  # type: ignore[union-attr]


def test_who_fails_twice_is_screened_out(desk: Desk) -> None:
    person = to_comprehension(desk)
    for choice in (0, 0):
        give(desk, person, choices=[choice])
        if position(*desk, now(desk, person)).page:
            give(desk, person)  # the instructions
    assert position(*desk, now(desk, person)).ended == "screened_out"


def test_an_answer_that_comes_twice_counts_once(desk: Desk) -> None:
    person = to_comprehension(desk)
    give(desk, person)
    page = position(*desk, person).page
    assert page is not None
    assert take(*desk, person, Answer(page.name, 1, {"at": 0.25, "confidence": 1}, 1, 0)) == ANSWER_TAKEN
    assert take(*desk, person, Answer(page.name, 1, {"at": 0.75, "confidence": 9}, 1, 0)) == ANSWERED_BEFORE
    assert desk[1].answers_of(person)[-1].value == {"at": 0.25, "confidence": 1}


@pytest.mark.parametrize(
    ("page", "attempt", "value"),
    [
        ("debriefing", 1, {}),
        ("instructions", 2, {}),
        ("trial/1/1", 1, {"at": 0.5, "confidence": 50}),
        ("nothing", 1, {}),
        ("comprehension", 1, {"choices": [2]}),
        ("comprehension", 1, {"choices": [True]}),
        ("comprehension", 1, {"choices": [1, 1]}),
        ("comprehension", 1, {"choices": "1"}),
        ("comprehension", 1, {"choices": [1], "more": 1}),
        ("comprehension", 1, {}),
    ],
)
def test_out_of_order_or_unfit_is_refused_and_nothing_is_lost(
    desk: Desk, page: str, attempt: int, value: dict[str, Any]
) -> None:
    person = to_comprehension(desk)
    before = desk[1].answers_of(person)
    with pytest.raises(BadAnswerError):
        take(*desk, person, Answer(page, attempt, value, 1, 0))
    assert desk[1].answers_of(person) == before
    assert position(*desk, person).page.name == "comprehension"  # type: ignore[union-attr]


@pytest.mark.parametrize("at", [-0.01, 1.01, float("nan"), "0.5", True, None])
def test_a_place_outside_the_picture_is_refused(desk: Desk, at: Any) -> None:
    person = to_comprehension(desk)
    give(desk, person)
    with pytest.raises(BadAnswerError, match="at does not fit"):
        give(desk, person, at=at, confidence=50)


def test_an_id_takes_part_once(desk: Desk) -> None:
    person = enter(*desk, recruiter="prolific", external="p1")
    give(desk, person)
    assert enter(*desk, recruiter="prolific", external="p1") == now(desk, person)
    assert enter(*desk, recruiter="prolific", external="p2").number != person.number


def test_the_quota_counts_people_not_pilots(desk: Desk) -> None:
    for _ in range(8):
        enter(*desk, pilot=True)
    people = [enter(*desk) for _ in range(6)]
    assert sorted(person.arms for person in people) == [("ibe",)] * 3 + [("none",)] * 3
    with pytest.raises(FullError):
        enter(*desk)
    give(desk, people[0], agrees=False)
    assert enter(*desk).arms == people[0].arms


def test_somebody_who_was_given_up_may_go_on(desk: Desk) -> None:
    person = to_comprehension(desk)
    desk[1].release(-1.0)
    late = now(desk, person)
    assert late.ended == "timed_out"
    assert position(*desk, late).page.name == "comprehension"  # type: ignore[union-attr]
    give(desk, late)
    assert now(desk, person).ended is None


def test_a_place_is_held_until_it_is_taken(desk: Desk) -> None:
    """It counts as begun only with its first answer; until then it keeps its arms and its number."""
    places = [lay_out(*desk) for _ in range(6)]
    assert sorted(one.arms for one in places) == [("ibe",)] * 3 + [("none",)] * 3
    assert desk[1].people() == []
    assert desk[1].begun()
    with pytest.raises(FullError):
        enter(*desk)
    place = now(desk, places[1])
    assert (place.ended, place.number) == ("laid_out", 2)
    assert desk[1].release(after_minutes=0) == 0
    assert give(desk, place) == ANSWER_TAKEN
    assert [(one.number, one.arms, one.ended) for one in desk[1].people()] == [(2, places[1].arms, None)]
    pilot = lay_out(*desk, pilot=True)
    assert (pilot.number, pilot.pilot) == (7, True)
