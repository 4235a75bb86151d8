"""Find the class that a ``kind`` names, and the settings of that class.

A kind is a class, and a YAML file in ``configs/GROUP`` (or below a ``--config-dir``) whose ``kind`` names it:
``my_package.my_module:MyMapping``, or for those of this package the name of their module. The class attribute
``settings`` is a dataclass derived from the group's; hydra takes fields, types and defaults from it.
An environment is named by its ``id`` instead; its ``settings`` are the arguments of its constructor (``env.kwargs``).
Nothing else lists kinds.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import gymnasium
from gymnasium.envs.registration import load_env_creator
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ibe_rl.config.limits import check, no_such_setting
from ibe_rl.config.own_words import hand_on_words
from ibe_rl.config.settings import (
    AgentConfig,
    InstructorConfig,
    ListenerConfig,
    LoggerConfig,
    MappingConfig,
    MetricConfig,
    PredictorConfig,
)
from ibe_rl.runtime.import_string import import_from_here, import_named
from ibe_rl.runtime.printed import raised
from ibe_rl.types import ConfigError

GROUPS: dict[str, type] = {
    "agent": AgentConfig,
    "instructor": InstructorConfig,
    "mapping": MappingConfig,
    "predictor": PredictorConfig,
    "listener": ListenerConfig,
    "logger": LoggerConfig,
    "metric": MetricConfig,
}
"""Groups of ``configs/`` whose files have a ``kind``, with the settings that all kinds share."""
SEVERAL = {"listener": "listeners", "logger": "loggers", "metric": "metrics"}
"""Groups of which a run can have several, and the setting that holds them by name."""
ROOMS = {"agent": "ibe_rl.agents", "instructor": "ibe_rl.instructors", "predictor": "ibe_rl.predict"}
"""The package with the module that a kind without a colon names."""
MAPPING = "ibe_rl.ibe.estimator:IBEMapping"
"""The class of a mapping whose kind has no colon."""
BASES = {"listener": "ibe_rl.vocabulary.listener:Listener", "metric": "ibe_rl.vocabulary.listener:Metric"}
"""The class that all kinds of a group derive from, where there is one."""


def implementation(group: str, kind: str) -> type[Any]:
    """The class of a kind.

    Raises:
        ConfigError: if there is none, it cannot be imported, or it or its settings are not of this group.
    """
    if group in ROOMS and ":" not in kind:
        found = _of_room(ROOMS[group], kind)
    else:
        found = import_named(f"{group}.kind", kind if ":" in kind else MAPPING, "module:Class")
    if not inspect.isclass(found):
        raise ConfigError(f"{group}.kind={kind}: no such kind; allowed is module:Class, or a file in configs/{group}")
    settings, base = getattr(found, "settings", GROUPS[group]), GROUPS[group]
    if not (inspect.isclass(settings) and is_dataclass(settings) and issubclass(settings, base)):
        raise ConfigError(
            f"{group}.kind={kind}: its settings are {settings}; allowed is a dataclass derived from {base.__name__}"
        )
    if group in BASES and not issubclass(found, import_named(group, BASES[group], "module:Class")):
        raise ConfigError(f"{group}.kind={kind}: allowed is a class derived from {BASES[group]}")
    return found


def _of_room(room: str, kind: str) -> Any:
    """The class with this ``kind`` in the module of that name, or None."""
    try:
        module = import_module(f"{room}.{kind}" if kind.isidentifier() else "")
    except (ModuleNotFoundError, ValueError):
        return None
    classes = [one for one in vars(module).values() if inspect.isclass(one) and not is_dataclass(one)]
    return next((one for one in classes if vars(one).get("kind") == kind), None)


def settings_of(group: str, kind: str | None) -> type[Any]:
    """The settings dataclass of a kind; for None the group's."""
    found: type[Any] = getattr(None if kind is None else implementation(group, kind), "settings", GROUPS[group])
    return found


def settings_of_env(env_id: str) -> type[Any] | None:
    """The dataclass ``settings`` of a registered environment's class; None if it has none."""
    settings = getattr(maker_of_env(env_id), "settings", None)
    return settings if inspect.isclass(settings) and is_dataclass(settings) else None


def maker_of_env(env_id: str) -> Any:
    """The class of a registered environment, or the function that makes it."""
    module, colon, name = env_id.rpartition(":")
    if colon:
        import_from_here(module)
    entry = gymnasium.registry[name].entry_point
    return load_env_creator(entry) if isinstance(entry, str) else entry


def made(group: str, config: Any, *args: Any, **kwargs: Any) -> Any:
    """Construct an instance of a kind, by its ``make`` if it has one."""
    found = implementation(group, config.kind)
    make: Callable[..., Any] = getattr(found, "make", found)
    return make(config, *args, **kwargs)


def make_several(group: str, configs: Mapping[str, Any]) -> list[Any]:
    """Make the configured listeners, loggers or metrics.

    Raises:
        ConfigError: if one raises an error.
    """
    several = []
    for name, config in configs.items():
        try:
            several.append(made(group, config))
        except ConfigError:
            raise
        except Exception as error:  # third-party code may raise anything
            raise ConfigError(f"{SEVERAL[group]}.{name}={config.kind}: it cannot be made ({raised(error)})") from None
    return several


def checked(settings: type[Any], values: Mapping[str, Any], key: str) -> Any:
    """Convert values to a settings dataclass; ``key`` is their place in the config.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    for name in values.keys() - {item.name for item in fields(settings)}:
        raise ConfigError(f"{key}.{name}={values[name]}: {no_such_setting(name, settings)}")
    try:
        config = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(settings), dict(values)))
    except OmegaConfBaseException as error:
        raise ConfigError(f"{key}.{error.full_key}: {str(error).splitlines()[0]}") from None
    check(config, f"{key}.")
    return config


def check_config(values: Any) -> None:
    """Refuse values outside their limits, unknown settings, those of another kind, and those that nothing reads.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check(values)
    hand_on_words(values)
    for group in GROUPS:
        config = getattr(values, group, None)
        if config is None:
            continue
        if type(config) is not settings_of(group, config.kind):
            raise ConfigError(
                f"{group}.kind={config.kind}: these are the settings of another kind; allowed is {group}=NAME, "
                "of a file with that kind"
            )
        _refuse_unread(group, config)


def _refuse_unread(group: str, config: Any) -> None:
    """Refuse what is set but has no effect; a dataclass of settings lists such fields in ``unread()``."""
    default = type(config)()
    for name, because in getattr(config, "unread", dict)().items():
        if getattr(config, name) != getattr(default, name):
            raise ConfigError(
                f"{group}.{name}={getattr(config, name)}: nothing reads it with {group}.{because}; "
                f"allowed is {getattr(default, name)}"
            )


def with_settings(saved: dict[str, Any]) -> dict[str, Any]:
    """Convert the parts of a saved config that have a kind to the settings of these kinds."""
    one = {group: _typed(group, saved[group]) for group in GROUPS.keys() - SEVERAL.keys() if group in saved}
    several = {
        key: {name: _typed(group, values) for name, values in saved[key].items()}
        for group, key in SEVERAL.items()
        if key in saved
    }
    return one | several


def _typed(group: str, values: dict[str, Any]) -> Any:
    schema = settings_of(group, str(values.get("kind", getattr(GROUPS[group], "kind", None))))
    return OmegaConf.select(OmegaConf.merge({group: OmegaConf.structured(schema)}, {group: values}), group)
