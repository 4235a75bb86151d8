"""study.yaml is checked before anybody sees it."""

from __future__ import annotations

import pytest

from ibe_rl.apps.study.settings import StudySettings, read_settings
from ibe_rl.types import ConfigError


def test_nothing_given_is_the_default_study() -> None:
    assert read_settings({}, "study.yaml") == StudySettings()


def test_what_is_given_counts() -> None:
    read = read_settings({"arms": ["none", "paper", "ibe"], "trials": {"each_arm": 4}, "quota": 9}, "study.yaml")
    assert (read.arms, read.trials.each_arm, read.trials.practice, read.quota) == (["none", "paper", "ibe"], 4, 2, 9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"armz": ["none"]}, "armz=.*no such setting; allowed are title.*did you mean arms"),
        ({"trials": {"each_arms": 3}}, "trials.each_arms=3: no such setting.*did you mean each_arm"),
        ({"trials": {"each_arm": 0}}, "trials.each_arm=0: allowed is at least 1"),
        ({"trials": {"each_arm": "many"}}, "trials.each_arm: .*many"),
        ({"trials": {"feedback": "sometimes"}}, "trials.feedback=sometimes: allowed is one of always, practice, never"),
        ({"arms": ["none", "ibee"]}, "arms=.*one of none, paper, ibe.*did you mean ibe"),
        ({"arms": []}, "allowed are different ones, at least one"),
        ({"arms": ["ibe", "ibe"], "test": {"arms": ["ibe", "ibe"]}}, "allowed are different ones"),
        (
            {"arms": ["ibe"], "test": {"arms": ["ibe"]}, "design": "within"},
            "allowed with design=within are two or more",
        ),
        (
            {"arms": ["ibe"], "test": {"arms": ["ibe"]}, "design": "mixed"},
            "allowed with design=mixed are two or more",
        ),
        (
            {"arms": ["paper", "ibe"], "test": {"arms": ["ibe", "paper"]}, "design": "mixed"},
            "arms=.*allowed with design=mixed are none and one or more others",
        ),
        ({"design": "both"}, "design=both: allowed is one of between, within, mixed"),
        (
            {"trials": {"task": "flying"}},
            "trials.task=flying: allowed is one of landing, next_words, what_if, which_agent",
        ),
        (
            {"recruiter": "sona", "completion_codes": {"finished": "C1", "screened_out": "", "no_consent": ""}},
            "completion_codes.finished=C1: allowed with recruiter=sona is the address",
        ),
        ({"arms": ["none", "paper"]}, "test.arms=.*one of none, paper"),
        ({"test": {"arms": ["ibe"]}}, "test.arms=.*allowed are two of none, ibe"),
        ({"recruiter": "prolific"}, "completion_codes.finished: needed with recruiter=prolific"),
        ({"completion_codes": {"finish": "C1"}}, "completion_codes.finish=C1.*did you mean finished"),
        ({"release_after_minutes": float("nan")}, "release_after_minutes=nan"),
        (["none"], "allowed are settings"),
        (None, "allowed are settings"),
    ],
)
def test_what_is_wrong_is_named(values, message: str) -> None:
    with pytest.raises(ConfigError, match=f"(?s)^my/study.yaml: .*{message}"):
        read_settings(values, "my/study.yaml")
