"""What study.yaml can say, checked before anything is served."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ibe_rl.config.limits import allowed_values, nearest, setting
from ibe_rl.config.yaml_file import settings_from
from ibe_rl.types import ConfigError

NONE, PAPER, IBE, PLACEBIC, TRUE_FUTURE = "none", "paper", "ibe", "placebic", "true_future"
ARMS = (NONE, PAPER, IBE, PLACEBIC, TRUE_FUTURE)
LANDING, NEXT_WORDS, ASK_WHAT_IF, WHICH_AGENT = "landing", "next_words", "what_if", "which_agent"
BETWEEN_PERSONS, WITHIN, MIXED = "between", "within", "mixed"
ALWAYS, PRACTICE, NEVER = "always", "practice", "never"
CODES, PROLIFIC, SONA, MTURK = "codes", "prolific", "sona", "mturk"


@dataclass
class TrialSettings:
    """The trials of a person."""

    task: str = setting(LANDING, choices=(LANDING, NEXT_WORDS, ASK_WHAT_IF, WHICH_AGENT))
    practice: int = setting(2, low=0, high=50)  # before the first block
    each_arm: int = setting(12, low=1, high=500)  # in the block of an arm
    transfer: int = setting(0, low=0, high=500)  # without explanations, after the last block
    attention_checks: int = setting(1, low=0, high=20)  # trials whose answer is asked for in words
    feedback: str = setting(PRACTICE, choices=(ALWAYS, PRACTICE, NEVER))
    confidence: bool = True  # 0 to 100 after each trial


@dataclass
class TestSettings:
    """The registered test."""

    arms: list[str] = field(default_factory=lambda: [IBE, NONE])  # the first is expected to err less
    alpha: float = setting(0.05, low=0.0001, high=0.5)
    resamples: int = setting(10_000, low=100, high=1_000_000)


@dataclass
class ExclusionSettings:
    """Who does not count in the registered test."""

    failed_attention_checks: int = setting(1, low=0, high=20)  # more than so many
    median_answer_s: float = setting(1.0, low=0.0, high=60.0)  # faster than that
    unfinished: bool = True


@dataclass
class StudySettings:
    """All of study.yaml.

    ``scales`` and ``language`` name files of the folder; whether these are there is checked when the folder is opened.
    """

    title: str = "What will it do next?"
    contact: str = ""  # who answers questions of participants
    language: str = "en"  # folder below texts/
    seed: int = setting(0, low=0)  # of assignment and order
    design: str = setting(BETWEEN_PERSONS, choices=(BETWEEN_PERSONS, WITHIN, MIXED))  # mixed: none, and one other arm
    arms: list[str] = field(default_factory=lambda: [NONE, IBE])
    quota: int = setting(60, low=1, high=100_000)  # people who finish
    release_after_minutes: float = setting(60.0, low=1.0, high=10_080.0)  # without an answer; the place is free again
    trials: TrialSettings = field(default_factory=TrialSettings)
    comprehension_attempts: int = setting(2, low=1, high=10)
    demographics: bool = True
    scales: list[str] = field(default_factory=lambda: ["satisfaction", "trust"])
    recruiter: str = setting(CODES, choices=(CODES, PROLIFIC, SONA, MTURK))
    completion_codes: dict[str, str] = field(default_factory=dict)  # finished, screened_out, no_consent
    hypotheses: list[str] = field(default_factory=list)
    test: TestSettings = field(default_factory=TestSettings)
    exclusions: ExclusionSettings = field(default_factory=ExclusionSettings)


ENDS = ("finished", "screened_out", "no_consent")
"""Ways out of a study, each with a completion code."""


def read_settings(values: Any, source: str) -> StudySettings:
    """Check the values of study.yaml.

    Args:
        values: of the file.
        source: its path, for messages.

    Raises:
        ConfigError: naming the file, the key, the value and what is allowed.
    """
    try:
        settings = settings_from(values, StudySettings)
        _check_lists(settings)
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from None
    return settings


def _check_lists(settings: StudySettings) -> None:
    _check_each("arms", settings.arms, ARMS)
    if settings.design != BETWEEN_PERSONS and len(settings.arms) < 2:
        raise ConfigError(
            f"arms={settings.arms}: allowed with design={settings.design} are two or more of {', '.join(ARMS)}"
        )
    if settings.design == MIXED and NONE not in settings.arms:
        raise ConfigError(f"arms={settings.arms}: allowed with design={MIXED} are {NONE} and one or more others")
    _check_each("test.arms", settings.test.arms, settings.arms)
    if len(settings.test.arms) != 2:
        raise ConfigError(f"test.arms={settings.test.arms}: allowed are two of {', '.join(settings.arms)}")
    unknown = [end for end in settings.completion_codes if end not in ENDS]
    if unknown:
        raise ConfigError(
            f"completion_codes.{unknown[0]}={settings.completion_codes[unknown[0]]}: "
            f"allowed are {', '.join(ENDS)}{nearest(unknown[0], ENDS)}"
        )
    missing = [end for end in ENDS if end not in settings.completion_codes]
    if settings.recruiter != CODES and missing:
        raise ConfigError(f"completion_codes.{missing[0]}: needed with recruiter={settings.recruiter}")
    for end, code in settings.completion_codes.items():
        if settings.recruiter == SONA and code and not code.startswith("https://"):
            raise ConfigError(
                f"completion_codes.{end}={code}: allowed with recruiter={SONA} is the address that it shows, from "
                "https:// to the place of survey_code, or nothing"
            )


def _check_each(key: str, values: list[str], allowed: Any) -> None:
    for value in values:
        if value not in allowed:
            raise ConfigError(
                f"{key}={values}: allowed is {allowed_values({'choices': tuple(allowed)})}{nearest(value, allowed)}"
            )
    if len(set(values)) != len(values) or not values:
        raise ConfigError(f"{key}={values}: allowed are different ones, at least one, of {', '.join(allowed)}")
