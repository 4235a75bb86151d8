"""Where the agent does not do as told: how often, whether it says so, and at which moments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.shares import phrase_shares
from ibe_rl.apps.summary.steps import StepTable
from ibe_rl.types import Array

MOST_MOMENTS = 8


def where_not_as_told(steps: StepTable, played: Sequence[PlayedEpisode]) -> dict[str, Any]:
    """How often the agent goes another way than told, by instruction, context and phase, and where for longest.

    Returns:
        ``went``: share of the told steps; ``said``: share of those at which it said a way; ``said_so``: share of the
        steps at which it went another way and had said so. ``by``: the same of parts. ``moments``: the longest.
    """
    return {
        **_row(steps, steps.everywhere()),
        "by": [
            {"by": kind, "name": name, **_row(steps, part)}
            for kind, name, part in _parts(steps)
            if not np.isnan(steps.against[part]).all()
        ],
        "moments": longest_moments(played),
    }


def _parts(steps: StepTable) -> Iterator[tuple[str, str, Array]]:
    for name in phrase_shares(steps.told):
        yield "instruction", name, steps.told == name
    contexts = phrase_shares(steps.context)
    for name in contexts if len(contexts) > 1 else ():
        yield "context", name, steps.context == name
    for name, part in steps.phases().items():
        yield "phase", name, part


def _row(steps: StepTable, part: Array) -> dict[str, Any]:
    return {
        "steps": int((part & ~np.isnan(steps.against)).sum()),
        "went": steps.share(steps.against, part),
        "said": steps.share(steps.said_against, part),
        "said_so": steps.share(steps.said_against, part & (steps.against == 1)),
    }


def longest_moments(played: Sequence[PlayedEpisode]) -> list[dict[str, Any]]:
    """The longest stretch of each episode in which it does not do as told, the longest of all first."""
    found = [max(stretches, key=lambda one: int(one["steps"])) for one in played if (stretches := _stretches(one))]
    return sorted(found, key=lambda one: -int(one["steps"]))[:MOST_MOMENTS]


def _stretches(one: PlayedEpisode) -> list[dict[str, Any]]:
    """Consecutive steps with the same instruction, none of which went as told."""
    keys = [(wrong == 1, told) for wrong, told in zip(one.against, one.told, strict=True)]
    groups = [(key, list(steps)) for key, steps in groupby(range(len(one)), key=keys.__getitem__)]
    return [
        {
            "seed": one.seed,
            "context": one.episode.context,
            "first_step": steps[0],
            "last_step": steps[-1],
            "steps": len(steps),
            "told": told,
            "said": _mostly(one.said, steps),
            "came": _mostly(one.came, steps),
        }
        for (wrong, told), steps in groups
        if wrong
    ]


def _mostly(words: Sequence[str], steps: Sequence[int]) -> str:
    return next(iter(phrase_shares(np.array([words[step] for step in steps], object))))
