"""Files of ``configs/`` and of ``--config-dir`` for hydra: those of a kind lead with the settings of that kind."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
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

from ibe_rl.config.arguments import named_path
from ibe_rl.config.kinds import GROUPS, SEVERAL, settings_of, settings_of_env
from ibe_rl.config.local_files import config_folders
from ibe_rl.config.settings import EnvConfig, ExplainConfig, TrainConfig, ViewerConfig
from ibe_rl.storage.run_folder import CONFIG, read_yaml

SHARED: dict[str, type] = GROUPS | {"env": EnvConfig, "viewer": ViewerConfig}
"""What ``schema`` in a file's defaults list stands for."""
SETTINGS, VALUES = ".settings", ".values"
"""Suffixes of a file's name: the settings of its kind, which hydra merges before it; the file without these."""


class KindFiles(FileConfigSource):
    """A folder of config files; a file with a ``kind`` is merged onto the settings of that kind.

    These settings are the first entry of the file's defaults list, so hydra knows them when it merges the file and
    the command line. A file that starts from another one takes its values, not the settings of its kind.
    """

    def load_config(self, config_path: str) -> ConfigResult:
        """Read a file, or make a config from the settings of its kind."""
        path = config_path.removesuffix(".yaml")
        group, _, name = path.partition("/")
        if name.endswith(SETTINGS) or (name == "schema" and group in SHARED):
            return ConfigResult(self.provider, self.full_path(), self._settings(group, name), {"package": None})
        loaded: ConfigResult = super().load_config(path.removesuffix(VALUES))
        if (group in GROUPS or group == "env") and name:
            _lead_with_settings(loaded, group, name)
        return loaded

    def _settings(self, group: str, name: str) -> Any:
        """The settings of the kind that a file names; for the name ``schema`` the group's."""
        if name == "schema":
            return OmegaConf.structured(SHARED[group])
        kind = _kind_in(super().load_config(f"{group}/{name.removesuffix(SETTINGS)}"), group)
        if group == "env":
            return OmegaConf.create({"kwargs": _defaults_of_env(str(kind))})
        return OmegaConf.structured(settings_of(group, kind))

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
        if name.endswith((SETTINGS, VALUES)):
            return bool(super().is_config(path.removesuffix(SETTINGS).removesuffix(VALUES)))
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
    """The kind that a file names, of an environment its id; or None."""
    own = loaded.config.get(group) if loaded.header["package"] == "_global_" else loaded.config
    kind = own.get("id" if group == "env" else "kind") if isinstance(own, DictConfig) else None
    return None if kind is None else str(kind)


def _defaults_of_env(env_id: str) -> dict[str, Any]:
    """The defaults of an environment's settings; none if it cannot be imported, which making it reports."""
    with suppress(Exception):  # third-party code may raise anything
        settings = settings_of_env(env_id)
        return {} if settings is None else asdict(settings())
    return {}


def _lead_with_settings(loaded: ConfigResult, group: str, name: str) -> None:
    whole, kind = loaded.header["package"] == "_global_", _kind_in(loaded, group)
    if group in SEVERAL and loaded.header["package"] is None and not name.endswith(VALUES):
        loaded.header["package"] = f"{SEVERAL[group]}.{name}"
    if kind is None or (group == "env" and ":" not in kind):
        return
    own = [] if name.endswith(VALUES) else [f"/{group}/{name}{SETTINGS}@{group if whole else '_here_'}"]
    loaded.config["defaults"] = [*own, *map(_values_of, loaded.config.get("defaults", []))]


def _values_of(entry: Any) -> Any:
    """An entry of a defaults list; another file of the same group without the settings of its kind."""
    plain = isinstance(entry, str) and entry not in ("_self_", "schema") and not {"/", "@"} & {*entry}
    return f"{entry}{VALUES}" if plain else entry


def resumed_choices(arguments: Sequence[str], configs: Path) -> list[str]:
    """The group choices of a resumed run, from which hydra knows the settings of their kinds."""
    resumed = [named_path(one.partition("=")[2]) for one in arguments if one.startswith("resume=")]
    try:
        saved = read_yaml(Path(resumed[0]) / CONFIG)
        given = {one.partition("=")[0] for one in arguments}
        folders = [KindFiles("", str(folder)) for folder in reversed(config_folders(configs, arguments))]
        return [
            f"{group}={chosen}"
            for group in GROUPS
            if group not in given and (chosen := _chosen(group, saved, folders)) is not None
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        return []  # resuming the run reports the error


def _chosen(group: str, saved: dict[str, Any], folders: Sequence[KindFiles]) -> str | None:
    """The choice of a group that matches a saved config, as on the command line; None if there is none."""
    names = {kind: name for folder in folders for kind, name in folder.kinds(group).items()}
    if group in SEVERAL:
        several = saved.get(SEVERAL[group], {})
        return f"[{','.join(several)}]" if several and all(one["kind"] in names for one in several.values()) else None
    return names.get(saved[group].get("kind"))


def register() -> None:
    """Register the two root configs and ``KindFiles`` with hydra."""
    store = ConfigStore.instance()
    store.store(name="train_schema", node=TrainConfig)
    store.store(name="explain_schema", node=ExplainConfig)
    Plugins.instance()  # registers hydra's own sources first
    SourcesRegistry.instance().types["file"] = KindFiles
