"""Kinds of instructor over any environment's rule."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ibe_rl.config import HumanConfig, InstructorConfig, RecordedConfig
from ibe_rl.data import Array, ConfigError, Instructor, Task
from ibe_rl.instruct.beside import Beside
from ibe_rl.instruct.recorded import LessonWriter


class Oracle:
    """Follows the environment's rule at every step."""

    def __init__(self, rule: Callable[[Array], Array]):
        self._rule = rule

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.data.Instructor``."""
        return self._rule(states), np.ones((len(rows), 1), np.float32)


class Silent:
    """Never says anything: what the agent does without instruction."""

    def __init__(self, instruction_size: int):
        self._size = instruction_size

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.data.Instructor``."""
        return np.zeros((len(states), self._size), np.float32), np.zeros((len(rows), 1), np.float32)


def make_instructor(config: InstructorConfig, task: Task, seed: int = 0, first: Instructor | None = None) -> Instructor:
    """Make the instructor that ``config`` asks for.

    Args:
        config: one of the kinds.
        task: of the environment.
        seed: of the draws of those that draw.

    Raises:
        ConfigError: for an unknown kind.
    """
    if config.kind == "oracle":
        return Oracle(task.rule)
    if config.kind == "silent":
        return Silent(task.instruction_size)
    if config.kind == "human":
        return Beside(first, Oracle(task.rule))
    raise ConfigError(f"instructor.kind={config.kind}: allowed is one of oracle, silent")


def stand_in(config: InstructorConfig) -> InstructorConfig:
    """Who instructs where no person can be: in evaluations, and in whatever is flown after the training."""
    if isinstance(config, HumanConfig | RecordedConfig):
        return InstructorConfig("silent" if config.others == "silent" else "oracle")
    return config
