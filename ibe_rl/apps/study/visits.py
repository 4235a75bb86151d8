"""Simulated people go through a served study, page by page, and note what the server has confirmed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ibe_rl.apps.study.answers import Answer, Answers
from ibe_rl.apps.study.episode_file import sides_of
from ibe_rl.apps.study.folder import Study
from ibe_rl.apps.study.schedule import TRIAL, Page
from ibe_rl.apps.study.simulated import Participant, answer_page, time_s
from ibe_rl.apps.study.sitting import schedule_of
from ibe_rl.apps.study.ways import Shown, Way
from ibe_rl.types import ConfigError

WENT_AWAY, REFUSED = "left", "refused"
"""Ways out of a visit that the server does not know: a person leaves without a word, or an answer was not taken."""
RELOAD_PROBABILITY = 0.05
"""That a person reloads a page before answering it."""


@dataclass
class Visit:
    """One simulated person's time in a study.

    Attributes:
        person: who it is.
        random: their lot.
        token: the secret in their address; empty until they are let in.
        ended: how they left.
        needed_s: how long a real person of that pace would have taken.
        confirmed: answers that the server said it has, as they were given.
        wrong_pages: times when a reload showed another page than before.
    """

    person: Participant
    random: np.random.Generator
    token: str = ""
    ended: str = ""
    needed_s: float = 0.0
    confirmed: list[Answer] = field(default_factory=list)
    wrong_pages: int = 0


async def go_through(visit: Visit, way: Way, study: Study, answers: Answers) -> None:
    """Answer page after page until the study or the person ends it.

    Args:
        visit: filled with what happens.
        way: to the server.
        study: that is served, opened.
        answers: of it; tells which person the server made of the visitor, and so which episode each page shows.

    Raises:
        ConfigError: if the server serves another study.
    """
    shown = await way.begin()
    visit.token = way.token
    pages: dict[str, Page] = {}
    while "page" in shown:
        pages = pages or _pages(study, answers, visit.token)
        if visit.random.random() < visit.person.drop_out:
            visit.ended = WENT_AWAY
            return
        if visit.random.random() < RELOAD_PROBABILITY:
            before, shown = shown, await way.reload()
            visit.wrong_pages += _at(before) != _at(shown)
        reply = await _answer(visit, way, study, shown, pages[shown["page"]])
        if REFUSED in reply:
            visit.ended = REFUSED
            return
        shown = reply["now"]
    visit.ended = shown["ended"]


def lost_and_changed(answers: Answers, visits: list[Visit]) -> tuple[int, int]:
    """How many confirmed answers the file lacks, and how many it has otherwise or twice."""
    lost = changed = 0
    for visit in visits:
        person = answers.person(visit.token)
        there = answers.answers_of(person) if person else []
        kept = {(one.page, one.attempt): one.value for one in there}
        given = {(one.page, one.attempt): one.value for one in visit.confirmed}
        lost += len(given.keys() - kept.keys())
        changed += sum(kept[at] != value for at, value in given.items() if at in kept) + len(there) - len(kept)
    return lost, changed


async def _answer(visit: Visit, way: Way, study: Study, shown: Shown, page: Page) -> Shown:
    value = answer_page(visit.person, study, page, shown["attempt"], visit.random)
    took_s = time_s(visit.person, visit.random)  # once the episode was played, as the page counts
    sent, reply = await way.give(shown, page, value, took_s)
    if REFUSED not in reply:
        visit.needed_s += played_s(study, page) + took_s
        visit.confirmed.append(sent)
    return reply


def played_s(study: Study, page: Page) -> float:
    """How long a trial's episode plays before it can be answered; 0 on other pages."""
    if page.kind != TRIAL:
        return 0.0
    sides = sides_of(study.stimuli[page.episode], study.settings.trials.task)
    return sum(len(side["frames"]) * side["frame_ms"] for side in sides) / 1000


def _pages(study: Study, answers: Answers, token: str) -> dict[str, Page]:
    person = answers.person(token)
    if person is None:
        raise ConfigError(f"study={study.folder}: the server serves another one; allowed is a server of this study")
    return {page.name: page for page in schedule_of(study, person)}


def _at(shown: Shown) -> tuple[Any, Any]:
    return shown.get("page"), shown.get("attempt")
