"""People are excluded by the rules of study.yaml, each for the first that fits, and counted."""

from __future__ import annotations

import pandas as pd

from ibe_rl.apps.study.exclusions import exclusion_counts, reasons
from ibe_rl.apps.study.settings import ExclusionSettings, StudySettings

PEOPLE = pd.DataFrame(
    [
        ("finished", 12, 0, 5.0),
        ("finished", 12, 2, 5.0),
        ("finished", 12, 1, 0.5),
        ("finished", 12, 3, 0.5),
        ("timed_out", 5, 0, 5.0),
        ("under_way", 0, 0, float("nan")),
        ("withdrawn", 0, 0, float("nan")),
        ("no_consent", 0, 0, float("nan")),
        ("screened_out", 0, 0, float("nan")),
    ],
    columns=["ended", "counted_trials", "failed_checks", "median_s"],
)


def test_each_has_the_first_reason_that_fits() -> None:
    found = reasons(PEOPLE, StudySettings())
    assert found.tolist() == [
        "",
        "attention",
        "fast",
        "attention",
        "unfinished",
        "unfinished",
        "withdrew",
        "no_consent",
        "screened_out",
    ]
    assert exclusion_counts(found) == {
        "withdrew": 1,
        "no_consent": 1,
        "screened_out": 1,
        "unfinished": 2,
        "attention": 2,
        "fast": 1,
        "no_answer": 0,
    }


def test_the_rules_are_those_of_the_study() -> None:
    rules = ExclusionSettings(failed_attention_checks=2, median_answer_s=0.1, unfinished=False)
    found = reasons(PEOPLE, StudySettings(exclusions=rules))
    assert found.tolist()[:6] == ["", "", "", "attention", "", "no_answer"]
