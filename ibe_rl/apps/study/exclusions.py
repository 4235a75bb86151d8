"""Who does not count in the registered test, by the rules of study.yaml, and how many these are."""

from __future__ import annotations

import pandas as pd

from ibe_rl.apps.study.answers import FINISHED, NO_CONSENT, SCREENED_OUT, WITHDRAWN
from ibe_rl.apps.study.settings import StudySettings

RULES = {
    "withdrew": "withdrew; their answers are deleted",
    "no_consent": "did not agree to take part",
    "screened_out": "did not pass the comprehension check",
    "unfinished": "did not finish",
    "attention": "failed too many attention checks",
    "fast": "answered too fast",
    "no_answer": "answered no trial that counts",
}
"""Reasons in the order in which they are looked at, and what they mean. A person has the first one that fits."""


def reasons(people: pd.DataFrame, settings: StudySettings) -> pd.Series:
    """Why each person does not count: a key of ``RULES``, empty for those who do.

    Args:
        people: as ``StudyData.people``.
        settings: of the study.
    """
    rules, ended = settings.exclusions, people["ended"]
    fits = {
        "withdrew": ended == WITHDRAWN,
        "no_consent": ended == NO_CONSENT,
        "screened_out": ended == SCREENED_OUT,
        "unfinished": (ended != FINISHED) & rules.unfinished,
        "attention": people["failed_checks"] > rules.failed_attention_checks,
        "fast": people["median_s"] < rules.median_answer_s,
        "no_answer": people["counted_trials"] == 0,
    }
    found = pd.Series("", index=people.index, dtype=object)
    for name in reversed(RULES):
        found[fits[name]] = name
    return found


def exclusion_counts(excluded: pd.Series) -> dict[str, int]:
    """How many people each rule excludes, in the order of the rules, those with nobody too."""
    return {name: int((excluded == name).sum()) for name in RULES}
