"""A person's way through a study: which page comes next, and whether an answer counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from ibe_rl.apps.study.answers import (
    FINISHED,
    LAID_OUT,
    NO_CONSENT,
    SCREENED_OUT,
    TIMED_OUT,
    Answer,
    Answers,
    Person,
)
from ibe_rl.apps.study.assignment import Order, assign
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.messages import BadAnswerError, check_answer
from ibe_rl.apps.study.questions import Question
from ibe_rl.apps.study.schedule import (
    ATTENTION,
    COMPREHENSION,
    CONSENT,
    DEBRIEFING,
    DEMOGRAPHICS,
    INSTRUCTIONS,
    SCALE,
    TRIAL,
    Page,
    pages_of,
)
from ibe_rl.apps.study.settings import ASK_WHAT_IF, NEXT_WORDS, WHICH_AGENT

ANSWER_TAKEN, ANSWERED_BEFORE = "taken", "answered before"
"""What became of an answer."""


MOST_SCHEDULES = 1024


class FullError(Exception):
    """The quota is filled by people who have finished or are under way."""


@dataclass(frozen=True)
class Position:
    """Where a person is.

    Attributes:
        page: that is to be answered; None at the end.
        attempt: at this page, from 1.
        ended: how the person left; None while under way.
        done: pages before this one.
        of: pages in all.
    """

    page: Page | None
    attempt: int
    ended: str | None
    done: int
    of: int


def enter(
    study: Study, answers: Answers, pilot: bool = False, recruiter: str = "", external: str = "", fields: Any = None
) -> Person:
    """Let somebody in, or in again: an ID of a recruiter takes part once.

    Raises:
        FullError: if there is no place left.
    """
    if recruiter and (known := answers.of_recruit(recruiter, external)):
        return known
    answers.release(study.settings.release_after_minutes)
    if not pilot and sum(map(len, answers.held(pilot))) >= study.settings.quota:
        raise FullError
    return answers.begin(_next_arms(study, answers, pilot), study.protocol, pilot, recruiter, external, fields)


def lay_out(study: Study, answers: Answers, pilot: bool = False) -> Person:
    """Give out the place of somebody who may begin later, by a bundle; the quota does not limit these."""
    with answers.transaction():
        person = answers.begin(_next_arms(study, answers, pilot), study.protocol, pilot)
        answers.end(person, LAID_OUT)
    return person


def _next_arms(study: Study, answers: Answers, pilot: bool) -> Order:
    number = len(answers.people(pilots=True, laid_out=True)) + 1
    return assign(study.orders, *answers.held(pilot), seed=study.settings.seed * 1_000_003 + number)


def position(study: Study, answers: Answers, person: Person) -> Position:
    """Where a person is, from what they have answered."""
    return _position(study, person, answers.answers_of(person))


def _position(study: Study, person: Person, given: Sequence[Answer]) -> Position:
    pages = schedule_of(study, person)
    if person.ended not in (None, TIMED_OUT, LAID_OUT):
        return Position(None, 1, person.ended, len(pages), len(pages))
    place, attempt = _place(study, pages, given)
    if place == len(pages):
        return Position(None, 1, FINISHED, place, place)
    return Position(pages[place], attempt, None, place, len(pages))


def take(study: Study, answers: Answers, person: Person, answer: Answer) -> str:
    """Keep an answer if it answers the page where the person is; on disk when this returns.

    Returns:
        ``ANSWER_TAKEN``, or ``ANSWERED_BEFORE`` if this page was answered before: the first answer stays.

    Raises:
        BadAnswerError: if it answers another page, or does not fit.
    """
    given = answers.answers_of(person)
    if any((one.page, one.attempt) == (answer.page, answer.attempt) for one in given):
        return ANSWERED_BEFORE
    at = _position(study, person, given)
    if at.page is None or (answer.page, answer.attempt) != (at.page.name, at.attempt):
        raise BadAnswerError(f"the page to answer is {at.page.name if at.page else 'none'}, attempt {at.attempt}")
    check_answer(
        at.page,
        answer.value,
        questions_of(study, at.page),
        study.settings.trials.task,
        study.settings.trials.confidence,
    )
    kept = answers.keep(person, answer, _end(study, at, answer.value))
    return ANSWER_TAKEN if kept else ANSWERED_BEFORE


def schedule_of(study: Study, person: Person) -> Sequence[Page]:
    """All pages of a person."""
    return _schedule(study, person.arms, person.number)


@lru_cache(maxsize=MOST_SCHEDULES)  # each message asks for it several times
def _schedule(study: Study, arms: Order, number: int) -> tuple[Page, ...]:
    return tuple(pages_of(study.settings, arms, len(study.stimuli), number))


def questions_of(study: Study, page: Page) -> list[Question]:
    """What a page asks; empty where the page has no questions of the folder."""
    if page.kind == ATTENTION:
        checks = study.questions[ATTENTION]
        return [checks[(int(page.name.rpartition("/")[2]) - 1) % len(checks)]]
    if page.kind == SCALE:
        return study.questions[page.block]
    if page.kind in (COMPREHENSION, DEMOGRAPHICS):
        return study.questions[page.kind]
    if page.kind == TRIAL and study.settings.trials.task in (NEXT_WORDS, ASK_WHAT_IF):
        return [Question("", tuple(study.stimuli[page.episode]["phrases"]))]
    if page.kind == TRIAL and study.settings.trials.task == WHICH_AGENT:
        return [Question("", (study.words["first"], study.words["second"]))]
    return []


def understood(questions: Sequence[Question], value: Mapping[str, Any]) -> bool:
    """Whether all questions that have a right option were answered rightly."""
    pairs = zip(questions, value["choices"], strict=True)
    return all(question.right in (None, chosen) for question, chosen in pairs)


def _place(study: Study, pages: Sequence[Page], given: Sequence[Answer]) -> tuple[int, int]:
    """The page to answer, and which attempt it is; a check that was not passed leads back to the instructions."""
    done = {(one.page, one.attempt): one for one in given}
    place, attempt = 0, 1
    while place < len(pages):
        page = pages[place]
        this = attempt if page.kind in (INSTRUCTIONS, COMPREHENSION) else 1
        answer = done.get((page.name, this))
        if answer is None:
            return place, this
        failed = page.kind == COMPREHENSION and not understood(study.questions[COMPREHENSION], answer.value)
        if failed and attempt < study.settings.comprehension_attempts:
            attempt, place = attempt + 1, [one.kind for one in pages].index(INSTRUCTIONS)
        else:
            place += 1
    return place, 1


def _end(study: Study, at: Position, value: Mapping[str, Any]) -> str | None:
    """How a person leaves with this answer; None if they go on."""
    assert at.page is not None
    if at.page.kind == CONSENT and not value["agrees"]:
        return NO_CONSENT
    if at.page.kind == COMPREHENSION and at.attempt >= study.settings.comprehension_attempts:
        return None if understood(study.questions[COMPREHENSION], value) else SCREENED_OUT
    return FINISHED if at.page.kind == DEBRIEFING else None
