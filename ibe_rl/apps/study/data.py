"""What people answered as tables: a row for each trial, for each item of a scale, and for each person.

No table holds a secret, an ID of a recruiter or a text that somebody wrote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ibe_rl.apps.study.answers import Answer, Answers, Person
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.schedule import ATTENTION, COMMENT, DEMOGRAPHICS, SCALE, TRIAL, Page
from ibe_rl.apps.study.sitting import questions_of, schedule_of

Given = Iterable[tuple[Person, Sequence[Answer]]]
"""People with their answers."""
THEN = ">"
"""Between the arms of a person, in order."""
TRIALS: Mapping[str, Mapping[str, Any]] = {
    "person": {"description": "Number of the person, from 1"},
    "arms": {"description": f"Arms of the person in the order of their blocks, {THEN} between them"},
    "arm": {"description": "Arm whose explanations were shown in this trial"},
    "block": {"description": "practice, the arm of the block, or transfer (without explanations, after all blocks)"},
    "task": {"description": "What was asked for"},
    "trial": {"description": "Place of the trial in its block, from 1", "minValue": 1},
    "order": {"description": "Place of the trial among all trials of the person, from 1", "minValue": 1},
    "episode": {"description": "Number of the episode, its file in stimuli/", "minValue": 0},
    "answer": {"description": "Answered place as a share of the picture's width, or number of the chosen option"},
    "truth": {"description": "What really came, in the same units as the answer"},
    "error": {
        "description": "Distance of the answered place from the true one; empty for choices",
        "unitText": "widths of the picture",
        "minValue": 0,
        "maxValue": 1,
    },
    "correct": {"description": "1 for the right choice, 0 for another; empty for places", "minValue": 0, "maxValue": 1},
    "loss": {
        "description": "Measure of the registered test: 100 error, or 100 for a wrong choice, 0 for the right one",
        "unitText": "percent",
        "minValue": 0,
        "maxValue": 100,
    },
    "confidence": {"description": "How sure the person was", "unitText": "percent", "minValue": 0, "maxValue": 100},
    "took_ms": {"description": "Time from the appearance of the page to the answer", "unitText": "ms", "minValue": 0},
    "hidden_ms": {"description": "How long of it another window hid the page", "unitText": "ms", "minValue": 0},
    "attention_ok": {"description": "1 if the person answered all attention checks rightly, else 0"},
}
"""Columns of the table of trials."""
ITEMS: Mapping[str, Mapping[str, Any]] = {
    "person": TRIALS["person"],
    "arms": TRIALS["arms"],
    "scale": {"description": "Name of the scale, or demographics"},
    "item": {"description": "Place of the item in it, from 1", "minValue": 1},
    "chosen": {"description": "Number of the chosen option, from 0; empty where it was left out", "minValue": 0},
    "score": {"description": "The same, counted from the other end for reversed items", "minValue": 0},
    "options": {"description": "How many options the item has", "minValue": 2},
    "reversed": {"description": "1 where the first option is the highest, else 0"},
}
"""Columns of the table of items."""
PEOPLE: Mapping[str, Mapping[str, Any]] = {
    "person": TRIALS["person"],
    "pilot": {"description": "1 for a simulated or invited person who tries the study out, else 0"},
    "arms": TRIALS["arms"],
    "ended": {"description": "How the person left; under_way if they have not"},
    "counted_trials": {"description": "Answered trials in the blocks of the arms", "minValue": 0},
    "failed_checks": {"description": "Attention checks that were answered wrongly", "minValue": 0},
    "median_s": {"description": "Median time of an answer in the blocks of the arms", "unitText": "s", "minValue": 0},
    "hidden_s": {"description": "How long another window hid the pages, in all", "unitText": "s", "minValue": 0},
    "excluded": {"description": "Why the person does not count in the registered test; empty if they do"},
}
"""Columns of the table of people."""
UNENDED = "under_way"


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


def counted(trials: pd.DataFrame) -> pd.DataFrame:
    """The trials in the blocks of the arms."""
    return trials[trials["block"].to_numpy() == trials["arm"].to_numpy()]


def loss_of(value: Mapping[str, Any], truth: Mapping[str, Any]) -> float:
    """How wrong an answer is, in percent: of the picture's width for a place; 0 or 100 for a choice."""
    if "at" in value:
        return 100 * abs(float(value["at"]) - float(truth["at"]))
    return 100.0 * (value["choice"] != truth["choice"])


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
