"""Answers to a small study, written by hand or by simulated people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ibe_rl.apps.study.answers import FILE, FINISHED, Answer, Answers, Person
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.simulated import answer_page, draw_people, time_s
from ibe_rl.apps.study.sitting import enter, schedule_of


def person(number: int, *arms: str, ended: str | None = FINISHED, pilot: bool = False) -> Person:
    return Person(number, "secret", arms, "hash", pilot, ended)


def said(page: str, took_ms: int = 2000, attempt: int = 1, **value: Any) -> Answer:
    return Answer(page, attempt, value, took_ms, 10)


def fill(study: Study, people: int, pilot: bool = True, reliance: tuple[float, float] = (0.0, 1.0)) -> Path:
    """Let simulated people answer every page; they come back later than any answer is given up."""
    answers = Answers(study.folder / FILE)
    for one in draw_people(people, seed=1, reliance=reliance):
        somebody = enter(study, answers, pilot=pilot)
        random = np.random.default_rng([somebody.number, 5])
        for page in schedule_of(study, somebody):
            value = answer_page(one, study, page, 1, random)
            answers.keep(somebody, Answer(page.name, 1, value, int(1000 * time_s(one, random)), 0))
        answers.end(somebody, FINISHED)
    answers.close()
    return study.folder


def trials(rows: Sequence[tuple[int, int, str, float]], **more: Any) -> pd.DataFrame:
    """Trials that count, from (person, episode, arm, loss)."""
    table = pd.DataFrame(rows, columns=["person", "episode", "arm", "loss"])
    return table.assign(arms=table["arm"], block=table["arm"], **more)
