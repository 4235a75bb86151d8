"""One instructor, live or recorded, for the first environment, and another for the rest."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.instructors.cloned import ClonedInstructor
from ibe_rl.instructors.habits import HabitsConfig
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.instructors.silent import Silent
from ibe_rl.instructors.taught import ORACLES, Told
from ibe_rl.storage.log_columns import TOLD_SIZE
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Instructor

OTHER_KINDS = ("habits", "oracle", "silent")
"""Instructors of the environments beside the first."""


@dataclass
class MixedConfig(InstructorConfig):
    """One instructor for the first environment; ``habits`` clones it for the others."""

    others: str = setting("habits", choices=OTHER_KINDS)  # instructor of the other environments


class Teacher(Instructor, Protocol):
    """The instructor of the environment that is taught."""

    @property
    def told(self) -> Told:
        """Who gave the last instruction, and what they marked; see ``ibe_rl.instructors.taught``."""


class MixedInstructor:
    """One instructor for the first row and one for the other rows, possibly a clone of the first.

    Args:
        first: of the first row.
        others: of the other rows; a ``ClonedInstructor`` learns from each episode of the first.
        oracle: of the other rows too while the person has handed over to it; None: never.

    Attributes:
        told_rows: ``(N, TOLD_SIZE)`` int32, of the first row what it tells, zeros of the others.
    """

    def __init__(self, first: Teacher, others: Instructor, oracle: Instructor | None = None):
        self._first, self._others, self._oracle = first, others, oracle
        self._episode: list[tuple[Array, Array, Array]] = []
        self.told_rows = np.zeros((1, TOLD_SIZE), np.int32)

    def reset(self, rows: Array) -> None:
        """See ``ibe_rl.types.Instructor``."""
        if len(rows) != len(self.told_rows):
            self.told_rows = np.zeros((len(rows), TOLD_SIZE), np.int32)
        if rows[0]:
            self._learn()
            self._first.reset(rows[:1])
        if len(rows) > 1:
            self._others.reset(rows[1:])

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        instruction, given = self._first.instruct(states[:1], rows[:1])
        if rows[0]:
            self.told_rows[0] = self._first.told
            if self.told_rows[0, 0] != ORACLES:  # that is nobody's habit
                self._episode.append((states[:1].copy(), instruction, given))
        if len(rows) == 1:
            return instruction, given
        handed_over = self._oracle is not None and self.told_rows[0, 0] == ORACLES
        theirs = (self._oracle if handed_over and self._oracle else self._others).instruct(states[1:], rows[1:])
        return np.concatenate([instruction, theirs[0]]), np.concatenate([given, theirs[1]])

    def _learn(self) -> None:
        if isinstance(self._others, ClonedInstructor) and self._episode:
            self._others.learn(*(np.concatenate(column) for column in zip(*self._episode, strict=True)))
        self._episode = []


def beside_others(first: Teacher, config: MixedConfig, task: Task) -> MixedInstructor:
    """Combine the first row's instructor with the one that the settings name for the others."""
    if config.others == "habits":
        return MixedInstructor(first, ClonedInstructor(task.instruction_size), Oracle.make(config, task, 0))
    return MixedInstructor(first, (Silent if config.others == "silent" else Oracle).make(config, task, 0))


def habits_stand_in(config: MixedConfig, run: Path) -> InstructorConfig:
    """The person's habits, where the person is not there."""
    return HabitsConfig(run=str(run), otherwise="oracle" if config.others == "oracle" else "silent")


def check_mixed(config: MixedConfig, collect: CollectConfig, task: Task) -> None:
    """Refuse settings with which a person cannot watch the first environment.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if collect.processes != 1:
        raise ConfigError(
            f"collect.processes={collect.processes} with instructor={config.kind}: allowed is 1, "
            "one environment is watched"
        )
    if collect.engine == "ray":
        raise ConfigError(f"collect.engine=ray with instructor={config.kind}: allowed is processes, on this machine")
    if task.words is None and task.instruction_size != 1:
        raise ConfigError(
            f"instructor={config.kind}: allowed is an environment whose instruction is one number, or instructor.words"
        )
