"""Environments in a worker process, whose errors reach the trainer as one message."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
from tensordict import TensorDictBase
from torchrl.collectors import BaseCollector

from ibe_rl.envs.errors import GateError
from ibe_rl.envs.instructed_envs import InstructedEnvs
from ibe_rl.runtime.child_errors import ChildErrors, report_error
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.types import Instructor


class WorkerEnvs(InstructedEnvs):
    """Environments of a worker process: an error of theirs is left to the trainer, and the process ends.

    Args:
        child_errors: the trainer's folder for it.
    """

    def __init__(
        self,
        envs: Sequence[gymnasium.Env[Any, Any]],
        instructor: Instructor,
        partial_episodes: Sequence[PartialEpisode],
        child_errors: Path,
    ):
        super().__init__(envs, instructor, partial_episodes)
        self._child_errors = child_errors

    def _reset(self, tensordict: TensorDictBase | None, **others: Any) -> TensorDictBase:
        with self._leaving():
            return super()._reset(tensordict, **others)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        with self._leaving():
            return super()._step(tensordict)

    @contextmanager
    def _leaving(self) -> Iterator[None]:
        try:
            yield
        except GateError as error:
            report_error(self._child_errors, str(error))
            raise SystemExit(1) from None  # TorchRL's worker would print a traceback


def raise_child_error(collector: BaseCollector) -> None:
    """Raise the error that a worker of the collector has left.

    Raises:
        GateError: if there is one.
    """
    child_errors: ChildErrors | None = getattr(collector, "child_errors", None)
    if child_errors and (said := child_errors.first()):
        raise GateError(said)
