"""Roll-outs that differ in the instruction only: a moment and its twins (``Moment.twin``) share their chance events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ibe_rl.types import Array, Moment

Acts = TypeVar("Acts")
"""How a policy acts in some futures."""


def originals_of(moments: Sequence[Moment]) -> Array:
    """For each moment the row ``(N,)`` whose chance events it has: that of its twin, or its own."""
    return np.array([row if moment.twin is None else moment.twin for row, moment in enumerate(moments)], int)


def twins_to_roll(moments: Sequence[Moment], by_rule: bool) -> Array:
    """Rows of the twins whose future may differ from their original's.

    A twin that is told the same has the same future, unless the original is told ``by_rule`` later on.
    """
    twins = [row for row, moment in enumerate(moments) if moment.twin is not None]
    return np.array([row for row in twins if by_rule or _told_anew(moments[row], moments)], int)


def _told_anew(twin: Moment, moments: Sequence[Moment]) -> bool:
    assert twin.twin is not None
    original = moments[twin.twin]
    return twin.given != original.given or not np.array_equal(twin.instruction, original.instruction)


def in_parts(own: Array, twins: Array, at_once: int) -> list[Array]:
    """Divide rows into parts of at most ``at_once``; twins never change how the others are divided.

    >>> [part.tolist() for part in in_parts(np.arange(3), np.array([3, 4]), 2)]
    [[0, 1], [2], [3, 4]]
    """
    if len(own) + len(twins) <= at_once:
        return [np.concatenate([own, twins])]
    return [rows[start : start + at_once] for rows in (own, twins) for start in range(0, len(rows), at_once)]


def places_of(parts: Sequence[Array], originals: Array) -> Array:
    """Where the result of each row is among those of all parts ``(N,)``; of a row in no part, its original's."""
    together, places = np.concatenate(parts), np.full(len(originals), -1)
    places[together] = np.arange(len(together))
    return np.where(places < 0, places[originals], places)


@dataclass(frozen=True)
class Batch:
    """Rows to be rolled out together by members: what lies at ``l`` belongs to member ``l`` modulo their number.

    Attributes:
        rows: ``(R,)`` of the moments.
        layout: ``(L,)`` which row lies where; some lie in several places.
        places: ``(R,)`` where each of ``rows`` lies.
    """

    rows: Array
    layout: Array
    places: Array

    def of_rows(self, begin: Callable[[Array], Acts]) -> Callable[[Array], Acts]:
        """From what takes rows of the moments to what takes places in the layout."""
        return lambda futures: begin(self.layout[futures])


def twins_apart(originals: Array, members: int) -> Iterator[Batch]:
    """The moments, then their twins, which belong to the members of their originals.

    They are in two batches, since another batch size may change the last digits of the moments' own futures.
    """
    stands_alone = originals == np.arange(len(originals))
    own, twins = np.flatnonzero(stands_alone), np.flatnonzero(~stands_alone)
    yield Batch(own, own, np.arange(len(own)))
    if len(twins):
        places = _places(np.searchsorted(own, originals[twins]) % members, members)
        layout = np.full(places.max() + 1, twins[0])
        layout[places] = twins
        yield Batch(twins, layout, places)


def _places(chosen: Array, members: int) -> Array:
    """Members ``(N,)`` to places, each a multiple of ``members`` above its member."""
    earlier = np.zeros(len(chosen), int)
    for member in range(members):
        rows = np.flatnonzero(chosen == member)
        earlier[rows] = np.arange(len(rows))
    return earlier * members + chosen
