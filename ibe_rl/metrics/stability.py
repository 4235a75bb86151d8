"""Does speech hold still? Changes of the phrase, those that are undone at once, and how late a lasting one is said."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ibe_rl.types import Array

FLICKER_STEPS = 5
"""A change that is undone within so many steps is a flicker."""
LASTING_STEPS = 10
"""A phrase that comes true for at least so many steps is one that should have been said."""
SAID_BEFORE_STEPS = 30
"""A lasting change may be said so many steps before it."""


def changes_of(phrases: Sequence[str]) -> tuple[Array, Array]:
    """Where the phrase of an episode changes, and which of these changes are undone within ``FLICKER_STEPS``.

    Args:
        phrases: ``T`` phrases, one a step.

    Returns:
        ``(T,)`` bool each.
    """
    spoken = np.asarray(phrases, object)
    changed = np.zeros(len(spoken), bool)
    changed[1:] = spoken[1:] != spoken[:-1]
    undone = np.zeros(len(spoken), bool)
    for step in np.flatnonzero(changed):
        undone[step] = spoken[step - 1] in spoken[step + 1 : step + FLICKER_STEPS + 1]
    return changed, undone


def lags_steps(spoken: Sequence[str], real: Sequence[str]) -> list[float]:
    """How many steps after each lasting change of the realised phrase it is said, and said for a while; NaN if never.

    Args:
        spoken: ``T`` phrases.
        real: ``T`` realised phrases.

    Returns:
        One number for each change after which the realised phrase stays for ``LASTING_STEPS``; below 0: said before.
    """
    starts = [*np.flatnonzero(changes_of(real)[0]).tolist(), len(real)]
    lasting = [(start, end) for start, end in itertools.pairwise(starts) if end - start >= LASTING_STEPS]
    return [_said_after(spoken, real[start], start, end) for start, end in lasting]


def _said_after(spoken: Sequence[str], phrase: str, start: int, end: int) -> float:
    for step in range(max(0, start - SAID_BEFORE_STEPS), end):
        if all(one == phrase for one in spoken[step : min(step + FLICKER_STEPS + 1, end)]):
            return float(step - start)
    return float("nan")


def stability(phrases: Sequence[str]) -> dict[str, float]:
    """Changes of the phrase in 100 steps, and the share of them that are undone; NaN where nothing changes."""
    changed, undone = changes_of(phrases)
    flicker = undone.sum() / changed.sum() if changed.any() else float("nan")
    return {"phrase_changes_per_100": 100 * float(changed.mean()), "flicker": float(flicker)}
