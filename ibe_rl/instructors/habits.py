"""The habits of a person who has taught, cloned from the log of that run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from ibe_rl.config.limits import MISSING, setting
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.instructors.cloned import MAX_STEPS, ClonedInstructor
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.instructors.silent import Silent
from ibe_rl.instructors.taught import ORACLES, taught_rows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import TRAJECTORIES
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Instructor


@dataclass
class HabitsConfig(InstructorConfig):
    """What a person used to say in similar states; from a run that they taught."""

    kind: str = "habits"
    run: str = MISSING  # folder of that run
    otherwise: str = setting("silent", choices=("silent", "oracle"))  # who instructs where the person said nothing yet


class Habits:
    """Says what the person said in similar states.

    Args:
        log: gives the log that the person's steps are in.
        instruction_size: d.
        otherwise: instructs until the person has said anything.
    """

    kind, settings = "habits", HabitsConfig

    def __init__(self, log: Callable[[], TrajectoryLog | None], instruction_size: int, otherwise: Instructor):
        self._log, self._size, self._otherwise = log, instruction_size, otherwise
        self._clone: ClonedInstructor | None = None
        self._learnt_at = -1
        self.episodes = 0

    @classmethod
    def make(cls, config: HabitsConfig, task: Task, seed: int) -> Self:  # noqa: ARG003 - it draws nothing
        """See ``ibe_rl.instructors``."""
        folder = Path(config.run) / TRAJECTORIES
        log = TrajectoryLog.open(folder) if (folder / "log.json").is_file() else None
        return cls.of(lambda: log, config, task)

    @classmethod
    def of(cls, log: Callable[[], TrajectoryLog | None], config: HabitsConfig, task: Task) -> Self:
        """Of a log that may still grow; ``config.run`` is not read."""
        otherwise = (Oracle if config.otherwise == "oracle" else Silent).make(config, task, 0)
        return cls(log, task.instruction_size, otherwise)

    @staticmethod
    def check(config: HabitsConfig, _collect: object, _task: Task) -> None:
        """Refuse a run that nobody taught.

        Raises:
            ConfigError: naming the run and what is allowed.
        """
        try:
            taught = len(taught_rows(TrajectoryLog.open(Path(config.run) / TRAJECTORIES)))
        except ValueError as error:
            raise ConfigError(f"instructor.run={config.run}: {error}; allowed is a run that a person taught") from None
        if not taught:
            raise ConfigError(f"instructor.run={config.run}: nobody taught it; allowed is a run that a person taught")

    @property
    def about(self) -> str:
        """Whose instructions these are, in words."""
        self._learn()
        if self._clone is None:
            return f"the person has said nothing yet; {type(self._otherwise).kind} instead"  # type: ignore[attr-defined]  # both have
        return f"the habits of the person who taught, from {self.episodes} of their episodes"

    def reset(self, rows: Array) -> None:
        """See ``ibe_rl.types.Instructor``; takes up what the person has said since."""
        self._learn()
        self._otherwise.reset(rows)

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        return (self._clone or self._otherwise).instruct(states, rows)

    def _learn(self) -> None:
        """Fit again if episodes have ended since."""
        log = self._log()
        if log is None or log.episodes_ended == self._learnt_at:
            return
        self._learnt_at, self._clone, self.episodes = log.episodes_ended, None, 0
        rows = taught_rows(log)
        steps_after = np.cumsum(log.index["steps"][rows][::-1])[::-1] - log.index["steps"][rows]
        newest = rows[steps_after < MAX_STEPS]
        told, clone = log.told(newest.tolist()), ClonedInstructor(self._size)
        pieces = []
        for episode, steps in zip(log.read(newest.tolist()), told, strict=True):
            own = steps[:, 0] != ORACLES
            if own.any():
                pieces.append((episode.states[:-1][own], episode.instructions[own], episode.given[own, None]))
        if pieces and any(given.any() for _, _, given in pieces):
            clone.learn(*(np.concatenate(column) for column in zip(*pieces, strict=True)))
            self._clone, self.episodes = clone, len(pieces)
