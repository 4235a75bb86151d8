"""One agent is instructed by somebody, live or from a record, the others by somebody else."""

from __future__ import annotations

import numpy as np

from ibe_rl.instructors.cloned import Habits
from ibe_rl.types import Array, Instructor


class Beside:
    """The first row's instructor and that of the others; these may be instructed as the first one's habits are.

    Args:
        first: of the first row.
        others: of the other rows; ``Habits`` learn from each episode of the first.
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
        if isinstance(self._others, Habits) and self._episode:
            self._others.learn(*(np.concatenate(column) for column in zip(*self._episode, strict=True)))
        self._episode = []
