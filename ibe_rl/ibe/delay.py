"""How late an instructor is, and what was said at the steps that it was about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ibe_rl.types import Array, Episode


@dataclass(frozen=True)
class Delay:
    """How late an instructor is, in steps of the environment.

    Attributes:
        steps: behind what it instructs about; 0 where that cannot be told.
        low: end of the 95 % interval over episodes; 0 where it cannot be told.
        high: likewise the other end; the longest delay looked for where it cannot be told.
        known: False if the log does not tell.
    """

    steps: int
    low: int
    high: int
    known: bool = True


def caught_up(episodes: Sequence[Episode], delay: Delay | None) -> list[Episode]:
    """The same episodes with what was said at the steps that it was about; nothing at the last ones."""
    if delay is None or not delay.steps:
        return [*episodes]
    return [
        replace(one, instructions=_earlier(one.instructions, delay.steps), given=_earlier(one.given, delay.steps))
        for one in episodes
    ]


def _earlier(column: Array, steps: int) -> Array:
    """The rows ``(T, ...)`` so many steps earlier; zeros where there are none."""
    moved = np.zeros_like(column)
    moved[: max(0, len(column) - steps)] = column[steps:]
    return moved
