"""Find the class that a ``kind`` names, and the settings of that class.

A kind is a class, and a YAML file in ``configs/GROUP`` (or below a ``--config-dir``) whose ``kind`` names it:
``my_package.my_module:MyMapping``, or for those of this package the name of their module. The class attribute
``settings`` is a dataclass derived from the group's; hydra takes fields, types and defaults from it.
Nothing else lists kinds.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.config_store import ConfigStore
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from ibe_rl.config.limits import check, no_such_setting
from ibe_rl.config.settings import (
    AgentConfig,
    EnvConfig,
    ExplainConfig,
    InstructorConfig,
    ListenerConfig,
    MappingConfig,
    MetricConfig,
    PredictorConfig,
    TrainConfig,
    ViewerConfig,
)
from ibe_rl.runtime.import_string import import_named, raised
from ibe_rl.types import ConfigError

GROUPS: dict[str, type] = {
    "agent": AgentConfig,
    "instructor": InstructorConfig,
    "mapping": MappingConfig,
    "predictor": PredictorConfig,
    "listener": ListenerConfig,
    "metric": MetricConfig,
}
"""Groups of ``configs/`` whose files have a ``kind``, with the settings that all kinds share."""
SEVERAL = {"listener": "listeners", "metric": "metrics"}
"""Groups of which a run can have several, and the setting that holds them by name."""
ROOMS = {"agent": "ibe_rl.agents", "instructor": "ibe_rl.instructors", "predictor": "ibe_rl.predict"}
"""The package with the module that a kind without a colon names."""
MAPPING = "ibe_rl.ibe.estimator:IBEMapping"
"""The class of a mapping whose kind has no colon."""
SETTINGS = ".settings"
"""Suffix of a file's name for the settings of its kind, a config that hydra merges before the file."""


def implementation(group: str, kind: str) -> type[Any]:
    """The class of a kind.

    Raises:
        ConfigError: if there is none, it cannot be imported, or its settings are not of this group.
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
    base = GROUPS[group]
    if kind is None or (group == "mapping" and ":" not in kind):
        return base
    found: type[Any] = getattr(implementation(group, kind), "settings", base)
    return found


def made(group: str, config: Any, *args: Any, **kwargs: Any) -> Any:
    """Construct an instance of a kind, by its ``make`` if it has one."""
    found = implementation(group, config.kind)
    make: Callable[..., Any] = getattr(found, "make", found)
    return make(config, *args, **kwargs)


def make_listeners(cfg: TrainConfig) -> list[Any]:
    """Make the configured listeners.

    Raises:
        ConfigError: if one raises an error.
    """
    return _make_several("listener", cfg.listeners)


def make_metrics(cfg: TrainConfig) -> list[Any]:
    """Make the configured metrics; see ``make_listeners``."""
    return _make_several("metric", cfg.metrics)


def _make_several(group: str, configs: dict[str, Any]) -> list[Any]:
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
    """Refuse values outside their limits, unknown settings, and the settings of another kind.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check(values)
    for group in GROUPS:
        config = getattr(values, group, None)
        if config is not None and type(config) is not settings_of(group, config.kind):
            raise ConfigError(
                f"{group}.kind={config.kind}: these are the settings of another kind; allowed is {group}=NAME, "
                "of a file with that kind"
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


class KindFiles(FileConfigSource):
    """A folder of config files; a file with a ``kind`` is merged onto the settings of that kind.

    These settings are the first entry of the file's defaults list, so hydra knows them when it merges the file and
    the command line.
    """

    def load_config(self, config_path: str) -> ConfigResult:
        """Read a file, or make a config from the settings of its kind."""
        path = config_path.removesuffix(".yaml")
        group, _, name = path.partition("/")
        if self._is_virtual(path):
            kind = None if name == "schema" else _kind_in(super().load_config(path.removesuffix(SETTINGS)), group)
            node = OmegaConf.structured(SHARED[group] if kind is None else settings_of(group, kind))
            return ConfigResult(self.provider, self.full_path(), node, {"package": None})
        loaded: ConfigResult = super().load_config(config_path)
        if group in GROUPS and name:
            _lead_with_settings(loaded, group, name)
        return loaded

    def is_group(self, config_path: str) -> bool:
        """Whether it is a folder or a group of kinds, even one without files."""
        return config_path in GROUPS or bool(super().is_group(config_path))

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """The files or folders of a group."""
        return super().list(config_path, results_filter) if super().is_group(config_path) else []

    def is_config(self, config_path: str) -> bool:
        """Whether it is a file, or the settings of one."""
        return self._is_virtual(config_path.removesuffix(".yaml")) or bool(super().is_config(config_path))

    def _is_virtual(self, path: str) -> bool:
        group, _, name = path.partition("/")
        if group in GROUPS and name.endswith(SETTINGS):
            return bool(super().is_config(path.removesuffix(SETTINGS)))
        return name == "schema" and group in SHARED

    def kinds(self, group: str) -> dict[str, str]:
        """Map the kinds of a group to the names of their files."""
        found: dict[str, str] = {}
        for file in sorted((Path(self.path) / group).glob("*.yaml")):
            with suppress(YAMLError, OSError, OmegaConfBaseException):  # a broken file names no kind
                kind = _kind_in(super().load_config(f"{group}/{file.stem}"), group)
                found |= {} if kind is None else {kind: file.stem}
        return found


def _kind_in(loaded: ConfigResult, group: str) -> str | None:
    """The kind that a file names, or None."""
    own = loaded.config.get(group) if loaded.header["package"] == "_global_" else loaded.config
    kind = own.get("kind") if isinstance(own, DictConfig) else None
    return None if kind is None else str(kind)


SHARED: dict[str, type] = GROUPS | {"env": EnvConfig, "viewer": ViewerConfig}
"""What ``schema`` in a file's defaults list stands for."""


def _lead_with_settings(loaded: ConfigResult, group: str, name: str) -> None:
    whole, kind = loaded.header["package"] == "_global_", _kind_in(loaded, group)
    if group in SEVERAL and loaded.header["package"] is None:
        loaded.header["package"] = f"{SEVERAL[group]}.{name}"
    if kind is None or (group == "mapping" and ":" not in kind):
        return
    entry = f"/{group}/{name}{SETTINGS}@{group if whole else '_here_'}"
    loaded.config["defaults"] = [entry, *loaded.config.get("defaults", [])]


def register() -> None:
    """Register the two root configs and ``KindFiles`` with hydra."""
    store = ConfigStore.instance()
    store.store(name="train_schema", node=TrainConfig)
    store.store(name="explain_schema", node=ExplainConfig)
    Plugins.instance()  # registers hydra's own sources first
    SourcesRegistry.instance().types["file"] = KindFiles
