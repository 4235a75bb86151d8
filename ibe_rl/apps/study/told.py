"""An agent that is told something else from a step on."""

from __future__ import annotations

import numpy as np

from ibe_rl.types import Array, Instructor


class ToldFrom:
    """Instructs as somebody else does, and from a step of a single episode on says one value."""

    def __init__(self, instructor: Instructor, step: int, value: Array):
        self._instructor, self._from, self._value, self._step = instructor, step, value, 0

    def reset(self, rows: Array) -> None:
        """See ``ibe_rl.types.Instructor``."""
        self._step = 0
        self._instructor.reset(rows)

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        instruction, given = self._instructor.instruct(states, rows)
        self._step += 1
        if self._step <= self._from:
            return instruction, given
        return np.broadcast_to(self._value, instruction.shape), np.ones_like(given)
