"""Which arm a person gets: balanced over those who have finished or are under way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

Order = tuple[str, ...]
"""The arms that a person goes through, in this order."""


def orders_of(arms: Sequence[str], within: bool) -> list[Order]:
    """All orders that are given out equally often.

    Args:
        arms: of the study.
        within: every person goes through all arms.

    Returns:
        One order for each arm, or the rows of a Williams design: each arm stands equally often at each place, and
        equally often after each other arm. With an odd number of arms it has twice as many rows.
    """
    if not within:
        return [(arm,) for arm in arms]
    count = len(arms)
    zigzag = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(count)]
    rows = [[(start + offset) % count for offset in zigzag] for start in range(count)]
    if count % 2:
        rows += [row[::-1] for row in rows]
    return [tuple(arms[index] for index in row) for row in rows]


def mixed_orders(arms: Sequence[str], without: str) -> list[Order]:
    """All orders in which a person has a block of one arm and a block without explanations, in either order.

    Args:
        arms: of the study.
        without: the arm without explanations.
    """
    pairs = [(without, arm) for arm in arms if arm != without]
    return [order for pair in pairs for order in (pair, pair[::-1])]


def assign(orders: Sequence[Order], finished: Sequence[Order], under_way: Sequence[Order], seed: int) -> Order:
    """The order for the next person.

    It is one of those that the fewest people hold, who have finished or are under way. Among these it is one that the
    fewest have finished, then drawn by lot.

    Args:
        orders: to give out.
        finished: of people who have finished.
        under_way: of people who may still finish.
        seed: of the lot; another one for each person.
    """
    done, held = Counter(finished), Counter(finished) + Counter(under_way)
    least = min((held[order], done[order]) for order in orders)
    equal = [order for order in orders if (held[order], done[order]) == least]
    return equal[int(np.random.default_rng(seed).integers(len(equal)))]
