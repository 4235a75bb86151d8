"""The instructor that follows the environment's rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from ibe_rl.task import Task
from ibe_rl.types import Array


class Oracle:
    """Gives the rule's instruction at every step."""

    kind = "oracle"

    def __init__(self, rule: Callable[[Array], Array]):
        self._rule = rule

    @classmethod
    def make(cls, _: Any, task: Task, seed: int) -> Self:  # noqa: ARG003 - it draws nothing
        """See ``ibe_rl.instructors``."""
        return cls(task.rule)

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        return self._rule(states), np.ones((len(rows), 1), np.float32)
