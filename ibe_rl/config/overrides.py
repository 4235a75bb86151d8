"""Settings as a Python program gives them: values, classes and dictionaries instead of a command line and files."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

from ibe_rl.config.arguments import quoted
from ibe_rl.config.kinds import GROUPS, SEVERAL, checked, implementation, settings_of
from ibe_rl.types import ConfigError


def as_overrides(values: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Values by name as a command line has them: ``{"collect": {"processes": 1}}`` to ``collect.processes=1``.

    Raises:
        ConfigError: if a value is of a type that no setting has.
    """
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from as_overrides(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}={_written(f'{prefix}{name}', value)}"


def _written(key: str, value: Any) -> str:
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | Path):
        return quoted(str(value))
    if isinstance(value, list | tuple):
        return f"[{','.join(_written(key, one) for one in value)}]"
    raise ConfigError(f"{key}={value!r:.80}: allowed are numbers, texts, lists and dictionaries of them, or None")


def chosen_kind(group: str, choice: Any) -> Any:
    """The settings of a kind that a program chose without a file.

    Args:
        group: such as "mapping".
        choice: a class, a dictionary with ``kind`` (a class or ``module:Class``) and settings, or the settings
            themselves, with ``kind``.

    Raises:
        ConfigError: if it is no kind of this group, or a setting does not fit.
    """
    if is_dataclass(choice) and not inspect.isclass(choice):
        values: dict[str, Any] = {**vars(choice)}
    elif isinstance(choice, Mapping):
        values = {**choice}
    else:
        values = {"kind": choice}
    kind = kind_name(group, values.get("kind"))
    implementation(group, kind)
    return checked(settings_of(group, kind), values | {"kind": kind}, group)


def kind_name(group: str, kind: Any) -> str:
    """A kind as run folders name it, ``module:Class`` for a class.

    Raises:
        ConfigError: if it is neither, or a class that other programs could not import.
    """
    if isinstance(kind, str):
        return kind
    if not inspect.isclass(kind):
        raise ConfigError(f"{group}.kind={kind!r:.80}: allowed is module:Class, or the class")
    name = f"{kind.__module__}:{kind.__qualname__}"
    if kind.__module__ == "__main__" or "<locals>" in name:
        raise ConfigError(
            f"{group}.kind={name}: allowed is a class at the top of a module of its own, which worker processes "
            "and the run folder can name"
        )
    return name


KINDS_OF_ONE = tuple(group for group in GROUPS if group not in SEVERAL)
"""Groups of which a run has one kind."""
