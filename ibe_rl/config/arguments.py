"""Translate command-line arguments into hydra overrides."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from hydra.core.override_parser.types import Quote, QuotedString

from ibe_rl.config.limits import typed_names
from ibe_rl.config.settings import ExplainConfig

WITH_PATH = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn")
"""Options whose value is the next argument, which may have an equals sign in it."""
OF_A_TRAINING = re.compile(r"(env|mapping)[.=]")
"""Settings that ``explain.py`` passes on when it creates an external agent's run folder."""


def as_hydra_reads(arguments: Sequence[str], script: str, resumed: Sequence[str]) -> list[str]:
    """Translate the arguments of a script into those of hydra.

    Args:
        arguments: as typed after the script, options and settings in any order.
        script: "train" or "explain".
        resumed: the choices of a resumed run, from ``resumed_choices``.
    """
    options, settings = sorted_arguments(arguments)
    renamed = [_renamed(one, script) for one in settings]
    if script == "explain":
        return [*options, *_passed_on(renamed)]
    return [*options, *resumed, *renamed]


def sorted_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The options and the settings; hydra refuses settings on both sides of an option."""
    options: list[str] = []
    settings: list[str] = []
    for before, one in pairwise(["", *arguments]):
        is_setting = before not in WITH_PATH and not one.startswith("-") and ("=" in one or one.startswith("~"))
        (settings if is_setting else options).append(one)
    return options, settings


def _renamed(argument: str, script: str) -> str:
    key, equals, value = argument.partition("=")
    field = typed_names(ExplainConfig).get(key) if script == "explain" else None
    return f"{field}={value}" if equals and field else argument


def _passed_on(arguments: list[str]) -> list[str]:
    """Pass settings of a training on as one value: ``explain.py`` cannot compose them itself."""
    passed = [one for one in arguments if OF_A_TRAINING.match(one)]
    if not passed:
        return arguments
    at = arguments.index(passed[0])
    rest = [one for one in arguments if one not in passed]
    return [*rest[:at], f"guest_settings=[{','.join(map(quoted, passed))}]", *rest[at:]]


def quoted(text: str) -> str:
    """Quote a text so that hydra reads it as one value."""
    return QuotedString(text, Quote.single).with_quotes()
