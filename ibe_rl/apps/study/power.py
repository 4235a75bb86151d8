"""How many people a study needs: whole studies with simulated people, scored, excluded and tested as the real one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE
from rich.table import Table

from ibe_rl.apps.study.answers import FINISHED, Answer, Person
from ibe_rl.apps.study.assignment import Order, assign
from ibe_rl.apps.study.columns import counted
from ibe_rl.apps.study.comparisons import ANALYSIS, POWER, WANTED, comparisons
from ibe_rl.apps.study.data import tables_of
from ibe_rl.apps.study.exclusions import reasons
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.registered import TwoArms, permutation_p
from ibe_rl.apps.study.schedule import ATTENTION, TRIAL, Page, pages_of
from ibe_rl.apps.study.simulated import Participant, answer_page, draw_people, time_s
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.metrics.effect import share
from ibe_rl.runtime.console import PlainConsole
from ibe_rl.storage.run_folder import write_json
from ibe_rl.types import ConfigError

_RESAMPLES = 999
"""Of each test: fewer than in the analysis, as only p below alpha counts."""
_STEPS, _LEAST_PEOPLE, _LEAST_STUDIES = 8, 4, 10
Draw = Callable[[int, int], list[Participant]]
"""Draws so many people by a seed."""


@dataclass
class SimulatedStudies:
    """Draws whole studies, each with the people who finish it.

    The order of arms, the episodes and the pages of the n-th person are the same in every study, as in the real one.
    A study with fewer people is the beginning of one with more.

    Args:
        study: opened.
        draw: of the people.
    """

    study: Study
    draw: Draw
    orders: list[Order] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pages = cache(self._pages_of)

    def _pages_of(self, number: int, arms: Order) -> list[Page]:
        pages = pages_of(self.study.settings, arms, len(self.study.stimuli), number)
        return [page for page in pages if page.kind == ATTENTION or (page.kind == TRIAL and page.block == page.arm)]

    def _order(self, number: int) -> Order:
        """The arms of the n-th person who finishes."""
        while len(self.orders) < number:
            seed = self.study.settings.seed * 1_000_003 + len(self.orders) + 1
            self.orders.append(assign(self.study.orders, self.orders, [], seed))
        return self.orders[number - 1]

    def trials(self, people: int, seed: int) -> pd.DataFrame:
        """The trials that count of the people who count, in one study with so many who finish."""
        random = np.random.default_rng([seed, people])
        given = [self._sitting(number, one, random) for number, one in enumerate(self.draw(people, seed), start=1)]
        data = tables_of(self.study, given, lambda _, person: self._pages(person.number, person.arms))
        kept = data.people["person"][reasons(data.people, self.study.settings) == ""]
        trials = counted(data.trials)
        return trials[trials["person"].isin(kept)]

    def _sitting(self, number: int, one: Participant, random: np.random.Generator) -> tuple[Person, list[Answer]]:
        person = Person(number, "", self._order(number), "", True, FINISHED)
        return person, [
            Answer(page.name, 1, answer_page(one, self.study, page, 1, random), int(1000 * time_s(one, random)), 0)
            for page in self._pages(number, person.arms)
        ]


def rejections(
    studies: SimulatedStudies, people: Sequence[int], count: int, seed: int, resamples: int = _RESAMPLES
) -> dict[tuple[str, str], np.ndarray]:
    """In which simulated studies the test rejects, by comparison: ``(count, len(people))`` bool."""
    settings = studies.study.settings
    found = {pair: np.zeros((count, len(people)), bool) for pair in comparisons(settings)}
    with progress_bar("simulated studies", count) as step:
        for row in range(count):
            trials = studies.trials(max(people), seed + row)
            for column, most in enumerate(people):
                some = trials[trials["person"].to_numpy() <= most]
                for pair, rejected in found.items():
                    p = permutation_p(TwoArms.of(some, pair), resamples, seed)
                    rejected[row, column] = p < settings.test.alpha
            step()
    return found


def power(
    folder: Path,
    most_people: int = 160,
    studies: int = 1_000,
    seed: int = 0,
    noise: float = 0.1,
    lapse: float = 0.05,
    reliance_low: float = 0.0,
    reliance_high: float = 1.0,
) -> None:
    """Simulate whole studies and print how many people each comparison needs for a power of 80 %.

    Args:
        folder: of the study; the numbers go to ``analysis/power.json`` in it.
        most_people: who finish, in the largest studies, all arms together.
        studies: simulated for each number of people.
        seed: the same settings and seed give the same table.
        noise: median of simulated people, in widths of the picture; of choices the share of others chosen.
        lapse: share of pages that they answer at random.
        reliance_low: least belief in the words, 0 to 1.
        reliance_high: most belief in the words; what lies between is equally frequent.

    Raises:
        ConfigError: naming the setting, its value and what is allowed; and as ``open_study``.
    """
    if most_people < _STEPS * _LEAST_PEOPLE:
        raise ConfigError(f"most_people={most_people}: allowed is {_STEPS * _LEAST_PEOPLE} or more")
    if studies < _LEAST_STUDIES:
        raise ConfigError(f"studies={studies}: allowed is {_LEAST_STUDIES} or more")
    study = open_study(folder)
    reliance = (reliance_low, reliance_high)
    simulated = SimulatedStudies(study, lambda count, lot: draw_people(count, lot, noise, lapse, reliance))
    people = [round(most_people * step / _STEPS) for step in range(1, _STEPS + 1)]
    rejected = rejections(simulated, people, studies, seed)
    rows = [_row(pair, people, each) for pair, each in rejected.items()]
    found = {
        "studies": studies,
        "seed": seed,
        "alpha": study.settings.test.alpha,
        "persons": {"noise": noise, "lapse": lapse, "reliance": reliance},
        "rows": rows,
    }
    where = study.folder / ANALYSIS
    where.mkdir(exist_ok=True)
    write_json(where / POWER, found)
    PlainConsole(soft_wrap=True).print(power_table(found))


def _row(pair: tuple[str, str], people: Sequence[int], found: np.ndarray) -> dict[str, Any]:
    shares = [share(column.tolist()).to_dict() for column in found.T]
    return {
        "arms": list(pair),
        "people": list(people),
        "power": shares,
        "needed": people_needed(people, [float(one["value"] or 0.0) for one in shares]),
    }


def people_needed(people: Sequence[int], shares: Sequence[float], wanted: float = WANTED) -> int | None:
    """The smallest number of people with the wanted power, between two numbers on a straight line.

    None if the largest number has less. If the smallest one has more, it is the answer.
    """
    for at, power_there in enumerate(shares):
        if power_there >= wanted:
            if not at:
                return int(people[0])
            below = shares[at - 1]
            part = (wanted - below) / (power_there - below)
            return int(np.ceil(round(people[at - 1] + part * (people[at] - people[at - 1]), 6)))
    return None


def power_table(found: dict[str, Any]) -> Table:
    """The power at each number of people, for the terminal."""
    table = Table(box=SIMPLE, show_edge=False, title_justify="left")
    table.title = f"power [95 % interval], {found['studies']} simulated studies each, alpha {found['alpha']:g}"
    table.add_column("people who finish", justify="right")
    for row in found["rows"]:
        table.add_column(" against ".join(row["arms"]), justify="right")
    for at, number in enumerate(found["rows"][0]["people"]):
        shares = [row["power"][at] for row in found["rows"]]
        table.add_row(str(number), *(f"{one['value']:.2f} [{one['low']:.2f}, {one['high']:.2f}]" for one in shares))
    needed = [row["needed"] for row in found["rows"]]
    most = found["rows"][0]["people"][-1]
    table.add_section()
    table.add_row(f"for {WANTED:.0%}", *(str(one) if one else f"more than {most}" for one in needed))
    return table
