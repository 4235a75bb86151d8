"""Hydra as this package uses it: where it finds config files, and how it launches the runs of a sweep."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import hydra
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from ibe_rl.config.kind_files import KindFiles, register
from ibe_rl.config.local_files import CONFIGS, ignored_configs, local_configs
from ibe_rl.runtime.apps import load_app


class LocalFiles(KindFiles):
    """``configs`` of the working directory: its groups only, as ``train.yaml`` may belong to another program."""

    @staticmethod
    def scheme() -> str:
        """The prefix of its paths."""
        return "local"

    def is_config(self, config_path: str) -> bool:
        """Whether it is a file in a group."""
        return "/" in config_path and super().is_config(config_path)


class LocalSearchPath(SearchPathPlugin):
    """Looks into ``configs`` of the working directory before the package's own."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Put the folder first, if there is one."""
        folder = local_configs()
        if folder is not None:
            search_path.prepend("working directory", f"{LocalFiles.scheme()}://{folder}")


class ParallelLauncher(Launcher):
    """Starts each run of a sweep in a process of its own, ``runs_at_once`` at a time."""

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Keep what is needed to compose the settings of each run; what to run is started anew, as a script."""
        del task_function
        self._context, self._config = hydra_context, config

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Run all; ends the program if one of them failed.

        Raises:
            ConfigError: before anything is started, if one of them cannot work.
        """
        settings = [self._composed(overrides) for overrides in job_overrides]
        sweep = Path(self._config.hydra.sweep.dir)
        load_app("--multirun")(sweep, job_overrides, settings, self._flags(), initial_job_idx)
        return [_done() for _ in job_overrides]

    def _composed(self, overrides: Sequence[str]) -> Any:
        """The settings of a run, as the dataclass that they are."""
        composed = self._context.config_loader.load_sweep_config(self._config, list(overrides))
        with read_write(composed), open_dict(composed):
            del composed["hydra"]
        return OmegaConf.to_object(composed)

    def _flags(self) -> list[str]:
        """Where this program was told to look for config files."""
        about = self._config.hydra
        told = [source.path for source in about.runtime.config_sources if source.provider == "command-line"]
        return [f"--config-name={about.job.config_name}", *(f"--config-dir={path}" for path in told)]


def _done() -> JobReturn:
    returned = JobReturn(status=JobStatus.COMPLETED)
    returned.return_value = None
    return returned


def prepare_hydra() -> None:
    """Register schemas, config files and the launcher; hydra itself takes launchers only from ``hydra_plugins``."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # otherwise hydra prints the error and exits
    sys.stderr.write(ignored_configs())
    register()
    plugins = Plugins.instance()
    for plugin in (LocalFiles, LocalSearchPath, ParallelLauncher):
        plugins.register(plugin)
    plugins.is_in_toplevel_plugins_module = _may_be_a_plugin


def _may_be_a_plugin(name: str) -> bool:
    ours = f"{ParallelLauncher.__module__}.{ParallelLauncher.__name__}"
    return name == ours or bool(Plugins.is_in_toplevel_plugins_module(name))


@contextmanager
def settings_at_hand() -> Iterator[None]:
    """Make the config files available to hydra, also outside ``run_script``."""
    if GlobalHydra.instance().is_initialized():
        yield
        return
    prepare_hydra()
    with hydra.initialize_config_dir(str(CONFIGS), version_base="1.3"):
        yield


def choices(group: str) -> dict[str, Any]:
    """All choices of a config group, each as ``train.py`` composes it; only inside ``run_script``."""
    return {name: choice(group, name) for name in choice_names(group)}


def choice(group: str, name: str) -> Any:
    """One choice of a config group, as ``train.py`` composes it; only inside ``run_script``."""
    return OmegaConf.to_object(hydra.compose("train", [f"{group}={name}"])[group])


def choice_names(group: str) -> list[str]:
    """The names of all choices of a config group."""
    with settings_at_hand():
        return list(GlobalHydra.instance().config_loader().get_group_options(group))


def given_settings() -> list[str]:
    """The settings as typed on the command line; none where a user's own program uses the package."""
    return list(HydraConfig.get().overrides.task) if HydraConfig.initialized() else []
