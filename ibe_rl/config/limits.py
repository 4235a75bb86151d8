"""Limits of settings: declared with each field, checked before anything is built."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Any

from ibe_rl.config.setting import KEPT as KEPT
from ibe_rl.config.setting import MISSING as MISSING
from ibe_rl.config.setting import TINY as TINY
from ibe_rl.config.setting import setting as setting
from ibe_rl.types import ConfigError


def kept_settings(config: Any, prefix: str = "") -> list[str]:
    """Names of the settings that a resumed run keeps; a group that is kept whole is one name."""
    found = []
    for item in fields(config):
        value = getattr(config, item.name)
        if item.metadata.get("kept"):
            found.append(f"{prefix}{item.name}")
        elif is_dataclass(value):
            found += kept_settings(value, f"{prefix}{item.name}.")
    return found


def check(config: Any, prefix: str = "") -> None:
    """Refuse values outside their limits, and unknown settings.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    for key, value, limits in _settings(config, prefix):
        allowed = allowed_values(limits) if limits else ""
        if value is not None and allowed and not _fits(value, limits):
            raise ConfigError(f"{key}={value}: allowed is {allowed}{nearest(str(value), limits['choices'])}")


def _settings(config: Any, prefix: str) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    known = {item.name for item in fields(config)}
    for added in vars(config).keys() - known:  # set by `+key=value`
        raise ConfigError(f"{prefix}{added}={getattr(config, added)}: {no_such_setting(added, type(config))}")
    for item in fields(config):
        value = getattr(config, item.name)
        if is_dataclass(value):
            yield from _settings(value, f"{prefix}{item.name}.")
        elif isinstance(value, dict) and any(map(is_dataclass, value.values())):
            for name, one in value.items():
                yield from _settings(one, f"{prefix}{item.name}.{name}.")
        else:
            yield f"{prefix}{item.name}", value, dict(item.metadata)


def _fits(value: Any, limits: dict[str, Any]) -> bool:
    if limits["choices"]:
        return value in limits["choices"]
    low, high = limits["low"], limits["high"]
    return math.isfinite(value) and (low is None or value >= low) and (high is None or value <= high)


def typed_names(schema: Any) -> dict[str, str]:
    """The settings of a dataclass as they are typed, mapped to the names of their fields.

    The metadata ``typed`` is the name of one that would clash with a group; None for one that nobody types.
    """
    names = {item.metadata.get("typed", item.name): item.name for item in fields(schema)}
    return {typed: name for typed, name in names.items() if typed is not None}


def no_such_setting(name: str, schema: Any) -> str:
    """What is wrong with a name, and which are allowed."""
    known = typed_names(schema)
    return f"no such setting; allowed are {', '.join(known)}{nearest(name, known)}"


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of an error line that asks for the most similar name, empty if none is similar."""
    similar = get_close_matches(name, list(known), n=1)
    return f"; did you mean {similar[0]}?" if similar else ""


def allowed_values(limits: Mapping[str, Any]) -> str:
    """The limits of a setting in words, empty without any."""
    if limits.get("choices"):
        return "one of " + ", ".join(limits["choices"])
    low = limits.get("low")
    parts = [] if low is None else ["above 0" if low == TINY else f"at least {low:g}"]
    parts += [f"at most {limits['high']:g}"] if limits.get("high") is not None else []
    return " and ".join(parts)
