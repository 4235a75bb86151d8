"""Translate command-line arguments into hydra overrides."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, Quote, QuotedString
from hydra.errors import HydraException

from ibe_rl.config.limits import typed_names
from ibe_rl.config.settings import ExplainConfig

WITH_PATH = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn")
"""Options whose value is the next argument, which may have an equals sign in it."""
MULTIRUN = ("-m", "--multirun")
OF_A_TRAINING = re.compile(r"\+{0,2}(env|mapping)[.=]")
"""Settings that ``explain.py`` passes on when it creates an external agent's run folder."""
FREE = ("env.kwargs", "env.task.hidden_goal")
"""Where any name may be set, also one that no file has."""
_REPLACED = re.compile(r"(\\*)\$\{")
"""What would be replaced by the value of another setting."""
PATHS = {
    "train": ("run_dir", "resume", "instructor.recording"),
    "explain": ("run", "run_dir", "output", "clip", "sweep", "agent", "agent_vec_normalize"),
}
"""Settings whose values are read as they are, not by hydra's grammar."""
LISTS_OF_TEXTS = ("instructor.words",)
"""Lists of texts, of which hydra's grammar does not know all scripts."""


def as_hydra_reads(arguments: Sequence[str], script: str, resumed: Sequence[str]) -> list[str]:
    """Translate the arguments of a script into those of hydra.

    Args:
        arguments: as typed after the script, options and settings in any order.
        script: "train" or "explain".
        resumed: the choices of a resumed run, from ``resumed_choices``.
    """
    options, settings = sorted_arguments(arguments)
    several = any(one in MULTIRUN for one in options)
    renamed = [_renamed(_readable(one, script, several), script) for one in settings]
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


def path_setting(key: str, path: Path) -> str:
    """A setting with a path, as hydra reads it in any folder; a shell may need quotes around it."""
    text = str(path.absolute())
    kept = _REPLACED.sub(r"\1\1\\${", text)
    return f"{key}={text if kept == text else quoted(kept)}"


def named_path(value: str) -> str:
    """The path that a value names: without hydra's quotes, and with the home folder in place of ``~``."""
    override = _parsed(f"path={value}")
    given = None if override is None or override.is_sweep_override() else override._value
    text = given.text if isinstance(given, QuotedString) else value
    if text.startswith("~") and not Path(text).exists():
        with suppress(RuntimeError):  # of a user without a home
            return str(Path(text).expanduser())
    return text


def _readable(argument: str, script: str, several: bool) -> str:
    """A setting as hydra takes it: in quotes where it would read something else, with ``++`` where names are free."""
    key, equals, value = argument.partition("=")
    override = _parsed(argument)
    if equals and key.lstrip("+") in PATHS[script]:
        swept = several and key != "run_dir" and override is not None and override.is_sweep_override()
        if swept and not Path(value).exists():
            return argument if "(" in value else f"{key}={','.join(map(_as_path, value.split(',')))}"
        return f"{key}={_as_path(value)}"
    if equals and override is None and key.lstrip("+") in LISTS_OF_TEXTS and re.fullmatch(r"\[.*\]", value):
        return f"{key}=[{','.join(quoted(one.strip()) for one in value[1:-1].split(','))}]"
    added = "++" if key.startswith(FREE) and value != "null" else ""
    return f"{added}{argument}" if override is not None or not equals else f"{added}{key}={quoted(value)}"


def _as_path(value: str) -> str:
    if value == "null":
        return value
    path, override = named_path(value), _parsed(f"path={value}")
    if path == value and override is not None and override.value() == value:
        return value
    return quoted(path)


def _parsed(argument: str) -> Override | None:
    """A setting as hydra reads it; None if it cannot."""
    try:
        return OverridesParser.create().parse_override(argument)
    except HydraException:
        return None


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
