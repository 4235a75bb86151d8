"""Which arms of a study are compared, and with what power this should be."""

from __future__ import annotations

from ibe_rl.apps.study.settings import NONE, StudySettings

ANALYSIS, POWER = "analysis", "power.json"
"""Folder of what an analysis writes, in that of a study; and the file of the simulated power in it."""
WANTED = 0.8
"""Power that a comparison should have."""


def comparisons(settings: StudySettings) -> list[tuple[str, str]]:
    """The registered comparison, then every other arm against the arm of reference."""
    first, second = settings.test.arms
    other = reference_of(settings)
    pairs = [(first, second), *((arm, other) for arm in settings.arms if arm != other)]
    return [pair for at, pair in enumerate(pairs) if {*pair} not in [{*earlier} for earlier in pairs[:at]]]


def reference_of(settings: StudySettings) -> str:
    """The arm that the others are held against: none, or where there is none the second registered one."""
    return NONE if NONE in settings.arms else settings.test.arms[1]
