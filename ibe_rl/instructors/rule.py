"""The instructors that need nothing but the environment's rule."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ibe_rl.types import Array


class Oracle:
    """Follows the environment's rule at every step."""

    def __init__(self, rule: Callable[[Array], Array]):
        self._rule = rule

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        return self._rule(states), np.ones((len(rows), 1), np.float32)


class Silent:
    """Never says anything: what the agent does without instruction."""

    def __init__(self, instruction_size: int):
        self._size = instruction_size

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        return np.zeros((len(states), self._size), np.float32), np.zeros((len(rows), 1), np.float32)
