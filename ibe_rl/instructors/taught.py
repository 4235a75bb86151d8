"""What a person has said in the environment that they teach, as the log of a run holds it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from ibe_rl.types import Array, Episode

SPEAKERS = ("person", "held", "oracle", "nobody")
"""Source of the instruction at a step: "held" is the person's earlier one still in force, "oracle" the rule."""
Told = tuple[int, int, int]
"""Numbers of a step in the log: who spoke (0: another environment), and a mark: in which episode (0: no mark, 1: this
one, 2: the one before, ...) and at which of its steps the explanation was made that the person calls wrong."""
MARKED_BEFORE = 10
"""So many episodes back can still be marked: they are short, and people take their time."""
NOT_TAUGHT: Told = (0, 0, 0)


class ToldLog(Protocol):
    """What is read of the trajectory log of a run; importing the log itself would make imports deeper."""

    def told_first(self) -> Array:
        """``Told`` of the first step of each episode, ``(E, 3)``."""

    def told(self, rows: Sequence[int] | Array) -> list[Array]:
        """``Told`` of the steps of some episodes, ``(T, 3)`` each."""

    def read(self, rows: Sequence[int] | Array) -> list[Episode]:
        """Some episodes."""


def told_of(by: str, mark: tuple[int, int] = (0, 0)) -> Told:
    """The numbers of a step.

    Args:
        by: one of ``SPEAKERS``.
        mark: episodes ago plus 1, and step, of an explanation called wrong; zeros without one.
    """
    return SPEAKERS.index(by) + 1, *mark


ORACLES = told_of("oracle")[0]
PERSONS = tuple(told_of(by)[0] for by in ("person", "held"))


def taught_rows(log: ToldLog) -> Array:
    """Rows of ``log.index`` of the episodes of the environment that a person teaches; empty if there is none."""
    return np.flatnonzero(log.told_first()[:, 0])


def taught_episodes(log: ToldLog, rows: Sequence[int], horizon_steps: int = 0) -> tuple[list[Episode], int]:
    """Episodes of the taught environment, with only the person's own instructions counted as given.

    An instruction does not count either where the person calls the explanation of that movement wrong: its window
    begins within half of ``horizon_steps`` of the marked one.

    Args:
        log: of the run.
        rows: from ``taught_rows``, oldest first.
        horizon_steps: n of the explanations.

    Returns:
        The episodes, and how many explanations of them were marked.
    """
    every, told = taught_rows(log).tolist(), log.told(taught_rows(log))
    marks = _marks(told)
    heard = dict(zip(every, zip(told, marks, strict=True), strict=True))
    episodes = [
        _heard(one, heard[row][0], heard[row][1], horizon_steps) for row, one in zip(rows, log.read(rows), strict=True)
    ]
    return episodes, sum(len(heard[row][1]) for row in rows)


def _marks(told: Sequence[Array]) -> list[set[int]]:
    """The marked steps of each episode; ``told`` ``(T, 3)`` of consecutive episodes."""
    marks: list[set[int]] = [set() for _ in told]
    for number, steps in enumerate(told):
        for _, ago, step in steps[steps[:, 1] > 0].tolist():
            if ago <= number + 1:
                marks[number + 1 - ago].add(step)
    return marks


def _heard(episode: Episode, told: Array, marks: set[int], horizon_steps: int) -> Episode:
    given, steps = np.isin(told[:, 0], PERSONS) & episode.given.astype(bool), np.arange(len(episode))
    for mark in marks:
        given &= abs(steps - mark) > horizon_steps // 2
    return replace(episode, given=given)
