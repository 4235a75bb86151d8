"""One instructor, live or recorded, for the first environment, and another for the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.instructors.cloned import ClonedInstructor
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.instructors.silent import Silent
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Instructor

OTHER_KINDS = ("oracle", "silent", "habits")
"""Instructors of the environments beside the first."""


@dataclass
class MixedConfig(InstructorConfig):
    """One instructor for the first environment; ``habits`` clones it for the others."""

    others: str = setting("oracle", choices=OTHER_KINDS)  # instructor of the other environments


class MixedInstructor:
    """One instructor for the first row and one for the other rows, possibly a clone of the first.

    Args:
        first: of the first row.
        others: of the other rows; a ``ClonedInstructor`` learns from each episode of the first.
    """

    def __init__(self, first: Instructor, others: Instructor):
        self._first, self._others = first, others
        self._episode: list[tuple[Array, Array, Array]] = []

    def reset(self, rows: Array) -> None:
        """See ``ibe_rl.types.Instructor``."""
        if rows[0]:
            self._learn()
            self._first.reset(rows[:1])
        if len(rows) > 1:
            self._others.reset(rows[1:])

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        instruction, given = self._first.instruct(states[:1], rows[:1])
        if rows[0]:
            self._episode.append((states[:1].copy(), instruction, given))
        if len(rows) == 1:
            return instruction, given
        theirs = self._others.instruct(states[1:], rows[1:])
        return np.concatenate([instruction, theirs[0]]), np.concatenate([given, theirs[1]])

    def _learn(self) -> None:
        if isinstance(self._others, ClonedInstructor) and self._episode:
            self._others.learn(*(np.concatenate(column) for column in zip(*self._episode, strict=True)))
        self._episode = []


def beside_others(first: Instructor, config: MixedConfig, task: Task) -> MixedInstructor:
    """Combine the first row's instructor with the one that the settings name for the others."""
    if config.others == "habits":
        return MixedInstructor(first, ClonedInstructor(task.instruction_size))
    rule = Oracle(task.rule, task.words is not None)
    return MixedInstructor(first, Silent(task.instruction_size) if config.others == "silent" else rule)


def others_stand_in(config: MixedConfig) -> InstructorConfig:
    """The instructor where the first one is not available."""
    return InstructorConfig("silent" if config.others == "silent" else "oracle")


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
    if config.others == "habits" and collect.envs_per_process == 1:
        raise ConfigError("instructor.others=habits with collect.envs_per_process=1: allowed is more than 1")
