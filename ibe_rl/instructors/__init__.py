"""Instructors: who tells the agents what to do, by a task's rule.

In: states of many environments, the task's rule, the settings of one kind. A kind is a module here or elsewhere; see
``make_instructor``.
Out: per environment an instruction, and whether one was given.
Imports: ``types``, ``task``, ``storage``, ``config``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ibe_rl.config.kinds import implementation, made
from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import Task
from ibe_rl.types import Instructor


def make_instructor(
    config: InstructorConfig, task: Task, seed: int = 0, person: Instructor | None = None
) -> Instructor:
    """Make the instructor of the kind that ``config`` names.

    A kind of instructor is a class like ``ibe_rl.types.Instructor``. Its constructor (or its ``make``, if it has
    one) takes its settings, the task and a seed. Class attributes: ``settings``, a dataclass derived from
    ``InstructorConfig``, and optionally ``check(settings, collect, task)``, which raises ``ConfigError``.

    Args:
        config: settings of one kind.
        task: of the environment.
        seed: of its random draws.
        person: instructs the first environment, for a live kind.

    Raises:
        ConfigError: for an unknown kind, or a recording that cannot be read.
    """
    live = {"person": person} if is_live(config) else {}
    instructor: Instructor = made("instructor", config, task, seed, **live)
    return instructor


def check_instructor(config: InstructorConfig, collect: CollectConfig, task: Task) -> None:
    """Refuse settings with which the instructor could not work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    checks = _declared(config, "check", None)
    if checks:
        checks(config, collect, task)


def stand_in(config: InstructorConfig, run: Path) -> InstructorConfig:
    """The instructor that replaces a person in episodes after the training: their habits, by the log of the ``run``."""
    other = _declared(config, "stand_in", None)
    stands_in: InstructorConfig = other(config, run) if other else config
    return stands_in


def make_stand_in(config: InstructorConfig, task: Task, seed: int, log: TrajectoryLog) -> Instructor:
    """The same during the training, in its evaluations and explained episodes: by what its ``log`` holds so far."""
    other = stand_in(config, log.folder.parent)
    of_log = _declared(other, "of", None)
    if other is not config and of_log:
        habits: Instructor = of_log(lambda: log, other, task)
        return habits
    return make_instructor(other, task, seed)


def named_instructor(instructor: Instructor) -> str | None:
    """Whose instructions these are, in words, where a person is behind them; else None."""
    return getattr(instructor, "about", None)


def is_live(config: InstructorConfig) -> bool:
    """Whether a person instructs."""
    return bool(_declared(config, "live", False))


def is_resumable(config: InstructorConfig) -> bool:
    """Whether a run with it can be resumed."""
    return bool(_declared(config, "resumable", True))


def speaks(config: InstructorConfig) -> bool:
    """Whether it ever gives an instruction."""
    return bool(_declared(config, "speaks", True))


def _declared(config: InstructorConfig, name: str, default: Any) -> Any:
    """A class attribute of the kind."""
    return getattr(implementation("instructor", config.kind), name, default)
