"""The launcher of sweeps; hydra finds launchers in this package only. The work is done in ``ibe_rl.apps.sweep``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf, open_dict, read_write


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
        from ibe_rl.apps.sweep.launch import (
            launch,  # not before there is a sweep: hydra imports this file at every start
        )

        settings = [self._composed(overrides) for overrides in job_overrides]
        launch(Path(self._config.hydra.sweep.dir), job_overrides, settings, self._flags(), initial_job_idx)
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
        paths = [source.path for source in about.runtime.config_sources if source.provider == "command-line"]
        return [f"--config-name={about.job.config_name}", *(f"--config-dir={path}" for path in paths)]


def _done() -> JobReturn:
    returned = JobReturn(status=JobStatus.COMPLETED)
    returned.return_value = None
    return returned
