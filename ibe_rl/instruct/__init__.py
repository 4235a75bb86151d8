"""Kinds of instructor over any environment's rule."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ibe_rl.data import Array, ConfigError, Instructor, Task


class Oracle:
    """Follows the environment's rule at every step."""

    def __init__(self, rule: Callable[[Array], Array]):
        self._rule = rule

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.data.Instructor``."""
        return self._rule(states), np.ones((len(states), 1), np.float32)


class Silent:
    """Never says anything: what the agent does without instruction."""

    def __init__(self, instruction_size: int):
        self._size = instruction_size

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.data.Instructor``."""
        return np.zeros((len(states), self._size), np.float32), np.zeros((len(states), 1), np.float32)


def make_instructor(kind: str, task: Task) -> Instructor:
    """Make the instructor called ``kind`` for an environment's task.

    Raises:
        ConfigError: for an unknown kind.
    """
    if kind == "oracle":
        return Oracle(task.rule)
    if kind == "silent":
        return Silent(task.instruction_size)
    raise ConfigError(f"instructor.kind={kind}: allowed is one of oracle, silent")
