"""Settings that a YAML file of its own holds, beside those of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ibe_rl.config.limits import check, no_such_setting
from ibe_rl.types import ConfigError

Schema = TypeVar("Schema")
LONGEST_REASON = 200


def settings_from(values: Any, schema: type[Schema]) -> Schema:
    """Convert what a file holds to a settings dataclass, within the limits of its fields.

    Args:
        values: of the file.
        schema: dataclass with defaults; its fields may be dataclasses.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not isinstance(values, Mapping):
        raise ConfigError("allowed are settings, KEY: VALUE in each line")
    _refuse_unknown(values, schema(), "")
    try:
        settings = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(schema), dict(values)))
    except (OmegaConfBaseException, ValueError) as error:
        key = getattr(error, "full_key", None)
        raise ConfigError(f"{f'{key}: ' if key else ''}{str(error).splitlines()[0][:LONGEST_REASON]}") from None
    assert isinstance(settings, schema)
    check(settings)
    return settings


def _refuse_unknown(values: Mapping[Any, Any], default: Any, prefix: str) -> None:
    known = {item.name: getattr(default, item.name) for item in fields(default)}
    for name, value in values.items():
        if name not in known:
            raise ConfigError(f"{prefix}{name}={value}: {no_such_setting(str(name), type(default))}")
        if is_dataclass(known[name]):
            if not isinstance(value, Mapping):
                raise ConfigError(f"{prefix}{name}={value}: allowed are settings, KEY: VALUE")
            _refuse_unknown(value, known[name], f"{prefix}{name}.")
