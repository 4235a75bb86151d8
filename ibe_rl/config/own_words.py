"""Hands the instructor's words on to the environment, whose task speaks them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ibe_rl.config.setting import setting
from ibe_rl.types import ConfigError


@dataclass(kw_only=True)
class OwnWords:
    """The words of whoever teaches, in place of numbers: of an instructor, which hands them on to the environment."""

    words: list[str] = field(default_factory=list)  # as said; an oracle's are those of its values, in rising order
    max_words: int | None = setting(None, low=1, high=12)  # places, also for later words; None: no more


def hand_on_words(values: Any) -> None:
    """Set ``env.words`` and ``env.max_words`` to those of the instructor, in settings that have both.

    Raises:
        ConfigError: if they were set to something else.
    """
    env, instructor = getattr(values, "env", None), getattr(values, "instructor", None)
    if not (hasattr(env, "words") and hasattr(instructor, "words")):
        return
    for name, unset in (("words", []), ("max_words", None)):
        asked, wanted = getattr(env, name), getattr(instructor, name)
        if asked not in (unset, wanted):
            raise ConfigError(f"env.{name}={asked}: allowed is instructor.{name}, which sets it")
        setattr(env, name, wanted)
