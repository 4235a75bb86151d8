"""One-line errors for command lines and configs."""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from pathlib import Path

from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException
from yaml import MarkedYAMLError

from ibe_rl.config.limits import nearest, no_such_setting
from ibe_rl.types import ConfigError

NO_CHOICE = "Config group override must be a string or a list"
"""The beginning of hydra's error for a group whose choice is null, and for a value without a name."""


_SEVERAL = re.compile(r"^Ambiguous value for argument '(.*)'$")
ONE_VALUE = r"\1: several values; allowed is one, with a point in a number, or -m for a run with each"


def one_line(error: BaseException) -> str:
    """Describe an error in one line: the key, the value and what is allowed."""
    if isinstance(error, MissingConfigException):
        return _unknown_choice(str(error))
    if is_refusal(error):
        return _refusal(error)
    cause = error if isinstance(error, ConfigError) else error.__cause__ or error
    if isinstance(error, HydraException) and isinstance(error.__context__, OmegaConfBaseException):
        cause = error.__context__
    text, key = str(cause), getattr(cause, "full_key", None)
    unknown = re.search(r"Key '(\w+)' not in '(\w+)'", text)
    if unknown:
        schema = getattr(cause, "object_type", None)
        return (
            f"{key or unknown[1]}: {no_such_setting(unknown[1], schema) if is_dataclass(schema) else 'no such setting'}"
        )
    if key and "is not in struct" in text:
        return f"{key}: no such setting; allowed is one that is there, or +{key}=VALUE to add it"
    first = text.strip().splitlines()[0] if text.strip() else type(error).__name__
    if isinstance(error, OverrideParseException):
        return f"{error.override}: {first}"
    return f"{key}: {first}" if key else _SEVERAL.sub(ONE_VALUE, first)


def _refusal(error: BaseException) -> str:
    if isinstance(error, MarkedYAMLError):
        at = error.problem_mark
        place = f"{at.name}, line {at.line + 1}, column {at.column + 1}" if at else "a config file"
        return f"{place}: {error.problem}; allowed is YAML"
    if isinstance(error, ValueError):
        return "GROUP=null, or a value without a name: allowed is GROUP=CHOICE, as agent=ppo, or NAME=VALUE"
    return (
        "a setting below one that is null, as env.task.name where the environment declares its own task; allowed are "
        "those of parts that are there"
    )


def is_refusal(error: BaseException) -> bool:
    """True for what hydra, omegaconf and yaml raise, outside their own errors, for settings that cannot be."""
    if isinstance(error, ValueError):
        return str(error).startswith(NO_CHOICE)
    below_null = isinstance(error, AssertionError) and str(error).startswith("Unexpected type")
    return below_null or isinstance(error, MarkedYAMLError)


def _unknown_choice(text: str) -> str:
    wanted = re.search(r"Could not find '([\w/]+)/([^'/]*)'", text) or re.search(r"'([\w/]+)/([\w.-]+)'", text)
    options = [line.strip() for line in text.splitlines() if line.startswith("\t") and "/" not in line]
    if wanted and not options:  # hydra lists no options for a list of choices
        folders = [Path(folder) / wanted[1] for folder in re.findall(r"path=\w+://(.+)", text)]
        options = [file.stem for folder in folders for file in folder.glob("*.yaml")]
    if not wanted:
        return text.splitlines()[0]
    names = ", ".join(sorted(set(options)))
    allowed = f"one of {names}" if names else "the name of a file in ./configs or below a --config-dir"
    return f"{wanted[1]}={wanted[2]}: allowed is {allowed}{nearest(wanted[2], options)}"
