"""What study.yaml can say, checked before anything is served."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ibe_rl.config.error_line import one_line
from ibe_rl.config.limits import allowed_values, check, nearest, no_such_setting, setting
from ibe_rl.types import ConfigError

NONE, PAPER, IBE, PLACEBIC, TRUE_FUTURE = "none", "paper", "ibe", "placebic", "true_future"
ARMS = (NONE, PAPER, IBE, PLACEBIC, TRUE_FUTURE)
BETWEEN, WITHIN = "between", "within"
ALWAYS, PRACTICE, NEVER = "always", "practice", "never"
RECRUITERS = ("codes", "prolific", "sona", "mturk")


@dataclass
class TrialSettings:
    """The trials of a person."""

    task: str = setting("landing", choices=("landing", "next_words"))
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
    design: str = setting(BETWEEN, choices=(BETWEEN, WITHIN))
    arms: list[str] = field(default_factory=lambda: [NONE, IBE])
    quota: int = setting(60, low=1, high=100_000)  # people who finish
    release_after_minutes: float = setting(60.0, low=1.0, high=10_080.0)  # without an answer; the place is free again
    trials: TrialSettings = field(default_factory=TrialSettings)
    comprehension_attempts: int = setting(2, low=1, high=10)
    demographics: bool = True
    scales: list[str] = field(default_factory=lambda: ["satisfaction", "trust"])
    recruiter: str = setting("codes", choices=RECRUITERS)
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
    if not isinstance(values, dict):
        raise ConfigError(f"{source}: allowed are settings, KEY: VALUE in each line")
    try:
        merged = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(StudySettings), values))
    except OmegaConfBaseException as error:
        raise ConfigError(f"{source}: {_unfit(error, values)}") from None
    assert isinstance(merged, StudySettings)
    try:
        check(merged)
        _check_lists(merged)
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from None
    return merged


def _unfit(error: OmegaConfBaseException, values: dict[str, Any]) -> str:
    """The key, the value and what is allowed."""
    path = str(getattr(error, "full_key", "") or "")
    group, _, name = path.rpartition(".")
    schema = {"": StudySettings, "trials": TrialSettings, "test": TestSettings, "exclusions": ExclusionSettings}.get(
        group
    )
    if schema and name and name not in {one.name for one in schema.__dataclass_fields__.values()}:
        given = values.get(group, {}) if group else values
        return f"{path}={given.get(name) if isinstance(given, dict) else given}: {no_such_setting(name, schema)}"
    return f"{path}: {one_line(error)[:200]}"


def _check_lists(settings: StudySettings) -> None:
    _check_each("arms", settings.arms, ARMS)
    if len(settings.arms) < 2 and settings.design == WITHIN:
        raise ConfigError(f"arms={settings.arms}: allowed with design={WITHIN} are two or more of {', '.join(ARMS)}")
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
    if settings.recruiter != "codes" and missing:
        raise ConfigError(f"completion_codes.{missing[0]}: needed with recruiter={settings.recruiter}")


def _check_each(key: str, values: list[str], allowed: Any) -> None:
    for value in values:
        if value not in allowed:
            raise ConfigError(f"{key}={values}: {allowed_values({'choices': tuple(allowed)})}{nearest(value, allowed)}")
    if len(set(values)) != len(values) or not values:
        raise ConfigError(f"{key}={values}: allowed are different ones, at least one, of {', '.join(allowed)}")
