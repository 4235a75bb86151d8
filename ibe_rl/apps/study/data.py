"""What people answered as tables: a row for each trial, for each item of a scale, and for each person.

No table holds a secret, an ID of a recruiter or a text that somebody wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ibe_rl.apps.study.answers import Answer, Answers, Person
from ibe_rl.apps.study.columns import ITEMS, PEOPLE, THEN, TRIALS, UNENDED, loss_of
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.schedule import ATTENTION, COMMENT, DEMOGRAPHICS, SCALE, TRIAL, Page
from ibe_rl.apps.study.sitting import questions_of, schedule_of

Given = Iterable[tuple[Person, Sequence[Answer]]]
"""People with their answers."""


@dataclass(frozen=True)
class StudyData:
    """The tables of a study; columns as in ``TRIALS``, ``ITEMS`` and ``PEOPLE``, the last one without ``excluded``."""

    trials: pd.DataFrame
    items: pd.DataFrame
    people: pd.DataFrame


def answers_given(answers: Answers, pilots: bool) -> Given:
    """All people, or all pilots, with their answers."""
    people = [one for one in answers.people(pilots=True) if one.pilot == pilots]
    return [(person, answers.answers_of(person)) for person in people]


def tables_of(
    study: Study, given: Given, pages_for: Callable[[Study, Person], Sequence[Page]] = schedule_of
) -> StudyData:
    """Score all answers.

    Args:
        study: opened; it has the truth.
        given: people with their answers; of a page that was answered repeatedly, the last answer counts.
        pages_for: a person's pages.
    """
    trials: list[tuple[Any, ...]] = []
    items: list[tuple[Any, ...]] = []
    people: list[tuple[Any, ...]] = []
    for person, answers in given:
        pages = pages_for(study, person)
        by_page = {answer.page: answer for answer in answers}
        answered = [(page, by_page[page.name]) for page in pages if page.name in by_page]
        failed = sum(_failed(study, page, answer) for page, answer in answered if page.kind == ATTENTION)
        arms = THEN.join(person.arms)
        seen = [pair for pair in answered if pair[0].kind == TRIAL]
        trials += [
            _trial(study, person.number, arms, order, pair, failed == 0) for order, pair in enumerate(seen, start=1)
        ]
        items += [row for page, answer in answered for row in _items(study, person.number, arms, page, answer)]
        people.append(_person_row(person, arms, failed, seen, answers))
    return StudyData(
        _frame(trials, [*TRIALS]),
        _frame(items, [*ITEMS]),
        _frame(people, [name for name in PEOPLE if name != "excluded"]),
    )


def _frame(rows: Sequence[tuple[Any, ...]], columns: list[str]) -> pd.DataFrame:
    return pd.DataFrame.from_records(rows, columns=columns)


def free_texts(study: Study, given: Given) -> list[tuple[int, str, str, str]]:
    """What people wrote: number of the person, page, question, text. It may tell who they are."""
    rows = []
    for person, answers in given:
        for answer in answers:
            if answer.page == COMMENT and answer.value["text"].strip():
                rows.append((person.number, COMMENT, "", answer.value["text"]))
            if answer.page == DEMOGRAPHICS:
                pairs = zip(study.questions[DEMOGRAPHICS], answer.value["choices"], strict=True)
                rows += [(person.number, DEMOGRAPHICS, one.text, text) for one, text in pairs if _written(text)]
    return rows


def _written(answer: Any) -> bool:
    return isinstance(answer, str) and bool(answer.strip())


def _failed(study: Study, page: Page, answer: Answer) -> bool:
    [check] = questions_of(study, page)
    return bool(answer.value["choice"] != check.right)


def _trial(
    study: Study, person: int, arms: str, order: int, pair: tuple[Page, Answer], attention_ok: bool
) -> tuple[Any, ...]:
    page, answer = pair
    value, truth = answer.value, study.stimuli[page.episode]["truth"]
    at, loss = "at" in value, loss_of(value, truth)
    key = "at" if at else "choice"
    scored = (value[key], truth[key], loss / 100 if at else np.nan, np.nan if at else 1 - loss / 100, loss)
    shown = (page.arm, page.block, study.settings.trials.task, int(page.name.rpartition("/")[2]), order, page.episode)
    timing = (answer.took_ms, answer.hidden_ms, int(attention_ok))
    return (person, arms, *shown, *scored, value.get("confidence", np.nan), *timing)


def _items(study: Study, person: int, arms: str, page: Page, answer: Answer) -> list[tuple[Any, ...]]:
    if page.kind not in (SCALE, DEMOGRAPHICS):
        return []
    name, rows = page.block or DEMOGRAPHICS, []
    for item, (asked, chosen) in enumerate(
        zip(questions_of(study, page), answer.value["choices"], strict=True), start=1
    ):
        if asked.options:
            number = np.nan if chosen is None else chosen
            score = len(asked.options) - 1 - number if asked.reversed else number
            rows.append((person, arms, name, item, number, score, len(asked.options), int(asked.reversed)))
    return rows


def _person_row(
    person: Person, arms: str, failed: int, seen: Sequence[tuple[Page, Answer]], answers: Sequence[Answer]
) -> tuple[Any, ...]:
    took = [answer.took_ms for page, answer in seen if page.block == page.arm]
    median = float(np.median(took)) / 1000 if took else np.nan
    hidden = sum(answer.hidden_ms for answer in answers) / 1000
    return (person.number, int(person.pilot), arms, person.ended or UNENDED, len(took), failed, median, hidden)
