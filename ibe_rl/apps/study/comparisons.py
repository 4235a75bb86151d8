"""Which arms of a study are compared, and with what power this should be."""

from __future__ import annotations

from ibe_rl.apps.study.settings import NONE, StudySettings

ANALYSIS, POWER = "analysis", "power.json"
"""Folder of what an analysis writes, in that of a study; and the file of the simulated power in it."""
WANTED = 0.8
"""Power that a comparison should have."""


def comparisons(settings: StudySettings) -> list[tuple[str, str]]:
    """The registered comparison, then every other arm against none, or against the last of them."""
    first, second = settings.test.arms
    other = NONE if NONE in settings.arms else settings.arms[-1]
    pairs = [(first, second), *((arm, other) for arm in settings.arms if arm != other)]
    return list(dict.fromkeys(pairs))
