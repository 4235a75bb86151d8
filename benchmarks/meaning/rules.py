"""Instructors: pure functions of the state, rare instructions, and plans in time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ibe_rl.types import Array, Instructor

Rule = Callable[[Array], Array]
"""States ``(..., S)`` to instructions ``(..., 1)``."""
Measure = Callable[[Array], Array]
"""States ``(..., S)`` to ``(...)``."""


def towards(measure: Measure, goal: float, dead_band: float) -> Rule:
    """Corrective: +1 below the goal, -1 above it, 0 within the dead band."""

    def rule(states: Array) -> Array:
        missing = goal - measure(states)
        return _said(np.where(np.abs(missing) > dead_band, np.sign(missing), 0))

    return rule


def the_sign_of(measure: Measure) -> Rule:
    """+1 where the measure is positive, -1 where it is negative."""
    return lambda states: _said(np.sign(measure(states)))


def only_below(measure: Measure, goal: float) -> Rule:
    """One-sided: +1 below the goal, else 0."""
    return lambda states: _said(measure(states) < goal)


def always(word: float) -> Rule:
    """The same at every step."""
    return lambda states: _said(np.full(states.shape[:-1], word))


def _said(words: Array) -> Array:
    return np.asarray(words, np.float32)[..., None]


class Rarely:
    """Follows the rule, but only speaks in short spells.

    Args:
        rule: of the state.
        share: of the steps in which it speaks.
        spell_steps: length of a spell.
        seed: of the draws.
    """

    def __init__(self, rule: Rule, share: float, spell_steps: int, seed: int):
        self._rule, self._spell_steps = rule, spell_steps
        self._begins = share / (spell_steps * (1 - share) + share)  # probability in each silent step
        self._random = np.random.default_rng([seed, 0xA1])
        self._left = np.zeros(0, np.int64)

    def reset(self, rows: Array) -> None:
        """Begin in silence."""
        if len(rows) != len(self._left):
            self._left = np.zeros(len(rows), np.int64)
        self._left[rows] = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        begins = rows & (self._left == 0) & (self._random.random(len(rows)) < self._begins)
        self._left = np.where(begins, self._spell_steps, self._left)
        given = (self._left > 0)[:, None].astype(np.float32)
        self._left = np.where(rows, np.maximum(self._left - 1, 0), self._left)
        return self._rule(states) * given, given


class Planned:
    """+1, 0 and -1 in spells that do not depend on the state.

    Args:
        shortest: of the spells, in steps.
        longest: likewise.
        seed: of the draws.
    """

    def __init__(self, shortest: int, longest: int, seed: int):
        self._bounds = shortest, longest + 1
        self._random = np.random.default_rng([seed, 0xA2])
        self._left = np.zeros(0, np.int64)
        self._word = np.zeros(0, np.float32)

    def reset(self, rows: Array) -> None:
        """Begin a spell in these rows."""
        if len(rows) != len(self._left):
            self._left, self._word = np.zeros(len(rows), np.int64), np.zeros(len(rows), np.float32)
        self._left[rows] = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        turn = rows & (self._left == 0)
        self._word = np.where(turn, self._random.integers(-1, 2, len(rows)), self._word).astype(np.float32)
        self._left = np.where(turn, self._random.integers(*self._bounds, len(rows)), self._left) - rows
        return self._word[:, None], np.ones((len(states), 1), np.float32)


MakeInstructor = Callable[[int], Instructor]
"""Seed of the draws to the instructor."""
