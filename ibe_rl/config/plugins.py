"""What hydra takes from this package: the launcher of sweeps, and config files of the working directory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from ibe_rl.config.kinds import KindFiles
from ibe_rl.config.local_files import local_configs
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

    __module__ = "hydra_plugins.ibe_rl"  # hydra takes launchers by such a name only; no package of that name is there

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


def register_plugins() -> None:
    """Tell hydra of them."""
    for plugin in (LocalFiles, LocalSearchPath, ParallelLauncher):
        Plugins.instance().register(plugin)
