"""Lets simulated people go through a study, in parallel and faster than time, and says what became of them."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from aiohttp import web
from rich.table import Table

from ibe_rl.apps.study.answers import FILE, FINISHED, SCREENED_OUT, Answers
from ibe_rl.apps.study.by_messages import message_door
from ibe_rl.apps.study.by_page import page_door
from ibe_rl.apps.study.folder import Study, hold_protocol, open_study
from ibe_rl.apps.study.recruiters import KNOWN
from ibe_rl.apps.study.server import study_app
from ibe_rl.apps.study.simulated import draw_people
from ibe_rl.apps.study.visits import REFUSED, WENT_AWAY, Visit, go_through, lost_and_changed
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.runtime.ports import HOST
from ibe_rl.types import ConfigError

THROUGH_PAGE, THROUGH_PROTOCOL = "page", "protocol"
COMING = 20
"""People who come within the time of an answer; without pauses all come at once."""
SLOWEST = 0.99
"""The quantile of confirmation times that is printed."""


@dataclass(frozen=True)
class Piloted:
    """What became of the simulated people.

    Attributes:
        visits: one for each.
        arms: of each, in the order of their blocks.
        lost: confirmed answers that the file lacks.
        changed: confirmed answers that the file has otherwise, or twice.
        confirmation_s: from each answer to its confirmation; empty through the page.
        took_s: for all.
    """

    visits: list[Visit]
    arms: list[tuple[str, ...]]
    lost: int
    changed: int
    confirmation_s: list[float]
    took_s: float


@dataclass(frozen=True)
class Hall:
    """Where the simulated people take part, and how; see ``pilot``."""

    study: Study
    answers: Answers
    address: str
    through: str
    chromium: str
    times_faster: float
    at_once: int


def pilot(  # noqa: PLR0913 - each is a setting of the command line
    folder: Path,
    people: int = 60,
    at_once: int = 20,
    through: str = THROUGH_PAGE,
    seed: int = 0,
    address: str = "",
    chromium: str = "",
    noise: float = 0.1,
    lapse: float = 0.05,
    reliance: tuple[float, float] = (0.0, 1.0),
    drop_out: float = 0.01,
    pace_s: float = 12.0,
    times_faster: float = float("inf"),
    say: Callable[[object], None] | None = None,
) -> Piloted:
    """Let simulated people take part in a study; their answers are marked and never count.

    Args:
        folder: of the study.
        people: how many simulated people.
        at_once: how many at the same time.
        through: page, the real one in a headless browser, or protocol, its messages alone.
        seed: of who they are and how they answer.
        address: of a server of this study on this machine; empty to start one for the pilot.
        chromium: path of the browser; empty to look for one.
        noise: median of people, in widths of the picture; of choices the share of others chosen.
        lapse: share of pages answered at random.
        reliance: lowest and highest belief in the words, 0 to 1.
        drop_out: probability of leaving at each page.
        pace_s: median time of an answer.
        times_faster: than people, through the protocol; inf for no pauses.
        say: prints a line or a table.

    Raises:
        ConfigError: if the study, the people, the server or the browser cannot be had.
    """
    if through not in (THROUGH_PAGE, THROUGH_PROTOCOL):
        raise ConfigError(f"through={through}: allowed is {THROUGH_PAGE} or {THROUGH_PROTOCOL}")
    if at_once < 1:
        raise ConfigError(f"at_once={at_once}: allowed is 1 or more")
    crowd = draw_people(people, seed, noise, lapse, reliance, drop_out, pace_s)
    lots = np.random.default_rng(seed).spawn(people)
    visits = [Visit(person, lot) for person, lot in zip(crowd, lots, strict=True)]
    study = open_study(folder)
    answers = Answers(folder / FILE)
    try:
        hold_protocol(study, answers)
        hall = Hall(study, answers, address.rstrip("/"), through, chromium, times_faster, at_once)
        begun = time.perf_counter()
        confirmation_s = asyncio.run(_all(hall, visits))
        took_s = time.perf_counter() - begun
        known = [answers.person(visit.token) for visit in visits]
        found = Piloted(
            visits,
            [one.arms if one else () for one in known],
            *lost_and_changed(answers, visits),
            confirmation_s,
            took_s,
        )
    finally:
        answers.close()
    tell = say or PlainConsole().print
    for part in pilot_report(found):
        tell(part)
    return found


def pilot_report(found: Piloted) -> list[object]:
    """A table of what became of the people, by arm, and a line on their answers."""
    table = Table(title="Simulated people")
    for name in ("arm", "began", "finished", "screened out", "left", "median minutes of who finished"):
        table.add_column(name, justify="left" if name == "arm" else "right")
    for arms in [*sorted(set(found.arms)), None]:
        some = [visit for visit, own in zip(found.visits, found.arms, strict=True) if arms in (None, own)]
        table.add_row("all" if arms is None else " then ".join(arms), *_row(some))
    confirmed = sum(len(visit.confirmed) for visit in found.visits)
    refused = sum(visit.ended == REFUSED for visit in found.visits)
    wrong = sum(visit.wrong_pages for visit in found.visits)
    lines: list[object] = [
        table,
        f"{confirmed} answers confirmed in {found.took_s:.1f} s: {found.lost} lost, {found.changed} changed or "
        f"doubled, {refused} refused, {wrong} wrong pages after a reload",
    ]
    if found.confirmation_s:
        slowest = slowest_ms(found.confirmation_s)
        lines.append(f"the slowest {1 - SLOWEST:.0%} of the answers were confirmed after {slowest:.0f} ms or more")
    return lines


def slowest_ms(confirmation_s: Sequence[float]) -> float:
    """The time in ms that the slowest 1 % of the confirmations took at least."""
    return 1000 * float(np.quantile(confirmation_s, SLOWEST))


def _row(visits: Sequence[Visit]) -> list[str]:
    ended = [visit.ended for visit in visits]
    needed = [visit.needed_s / 60 for visit in visits if visit.ended == FINISHED]
    counts = [len(visits), *(ended.count(how) for how in (FINISHED, SCREENED_OUT, WENT_AWAY))]
    return [*map(str, counts), f"{np.median(needed):.1f}" if needed else "-"]


async def _all(hall: Hall, visits: Sequence[Visit]) -> list[float]:
    """Everybody's visit, so many at once; how long the confirmations took."""
    places, confirmation_s = asyncio.Semaphore(hall.at_once), list[float]()
    async with AsyncExitStack() as stack:
        address = hall.address or await stack.enter_async_context(_served(hall.study, hall.answers))
        parameters = partial(parameters_of, hall.study)
        opened = (
            page_door(address, parameters, hall.chromium)
            if hall.through == THROUGH_PAGE
            else message_door(address, parameters, hall.times_faster, confirmation_s)
        )
        door = await stack.enter_async_context(opened)

        async def visited(number: int, visit: Visit) -> None:
            await asyncio.sleep(number * visit.person.pace_s / hall.times_faster / COMING)
            async with places, door(number) as way:
                await go_through(visit, way, hall.study, hall.answers)

        await asyncio.gather(*(visited(number, visit) for number, visit in enumerate(visits)))
    return confirmation_s


def parameters_of(study: Study) -> dict[str, str]:
    """What an address has for a simulated person: an ID that nobody has, as the study's recruiter would give it."""
    recruiter = KNOWN[study.settings.recruiter]
    return {**dict.fromkeys(recruiter.fields, "pilot"), recruiter.id: f"pilot-{secrets.token_hex(8)}", "pilot": "1"}


@asynccontextmanager
async def _served(study: Study, answers: Answers) -> AsyncIterator[str]:
    """A server of the study for the pilot alone; gives its address."""
    runner = web.AppRunner(study_app(study, answers), access_log=None)
    await runner.setup()
    try:
        site = web.TCPSite(runner, HOST, 0)
        await site.start()
        yield site.name
    finally:
        await runner.cleanup()
