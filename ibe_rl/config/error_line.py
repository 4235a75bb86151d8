"""One-line errors for command lines and configs."""

from __future__ import annotations

import re
from dataclasses import is_dataclass
from pathlib import Path

from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException
from yaml import MarkedYAMLError

from ibe_rl.config.limits import nearest, no_such_setting


def one_line(error: BaseException) -> str:
    """Describe an error in one line: the key, the value and what is allowed."""
    if isinstance(error, MissingConfigException):
        return _unknown_choice(str(error))
    if is_below_null(error):
        return (
            "a setting below one that is null, as env.task.name where the environment declares its own task; allowed "
            "are those of parts that are there"
        )
    if isinstance(error, MarkedYAMLError) and error.problem_mark is not None:
        at = error.problem_mark
        return f"{at.name}, line {at.line + 1}, column {at.column + 1}: {error.problem}; allowed is YAML"
    cause = error.__cause__ or error
    if isinstance(error, HydraException) and isinstance(error.__context__, OmegaConfBaseException):
        cause = error.__context__
    text = str(cause)
    unknown = re.search(r"Key '(\w+)' not in '(\w+)'", text)
    if unknown:
        schema, key = getattr(cause, "object_type", None), getattr(cause, "full_key", None) or unknown[1]
        return f"{key}: {no_such_setting(unknown[1], schema) if is_dataclass(schema) else 'no such setting'}"
    key = getattr(cause, "full_key", None)
    if key and "is not in struct" in text:
        return f"{key}: no such setting; allowed is one that is there, or +{key}=VALUE to add it"
    first = text.strip().splitlines()[0] if text.strip() else type(error).__name__
    if isinstance(error, OverrideParseException):
        return f"{error.override}: {first}"
    return f"{key}: {first}" if key else first


def is_below_null(error: BaseException) -> bool:
    """True for omegaconf's assertion about a setting whose parent is null."""
    return isinstance(error, AssertionError) and str(error).startswith("Unexpected type")


def _unknown_choice(text: str) -> str:
    wanted = re.search(r"Could not find '([\w/]+)/([\w.-]+)'", text) or re.search(r"'([\w/]+)/([\w.-]+)'", text)
    options = [line.strip() for line in text.splitlines() if line.startswith("\t") and "/" not in line]
    if wanted and not options:  # hydra lists no options for a list of choices
        folders = [Path(folder) / wanted[1] for folder in re.findall(r"path=\w+://(.+)", text)]
        options = [file.stem for folder in folders for file in folder.glob("*.yaml")]
    if not wanted:
        return text.splitlines()[0]
    names = ", ".join(sorted(set(options)))
    allowed = f"one of {names}" if names else "the name of a file in ./configs or below a --config-dir"
    return f"{wanted[1]}={wanted[2]}: allowed is {allowed}{nearest(wanted[2], options)}"
