"""The instructor that never gives an instruction."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from ibe_rl.task import Task
from ibe_rl.types import Array


class Silent:
    """Never gives an instruction."""

    kind, speaks = "silent", False

    def __init__(self, instruction_size: int):
        self._size = instruction_size

    @classmethod
    def make(cls, _: Any, task: Task, seed: int) -> Self:  # noqa: ARG003 - it draws nothing
        """See ``ibe_rl.instructors``."""
        return cls(task.instruction_size)

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        return np.zeros((len(states), self._size), np.float32), np.zeros((len(rows), 1), np.float32)
