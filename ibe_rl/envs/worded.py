"""Gives an environment's task the words of whoever teaches, in place of its numbers and phrases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError
from ibe_rl.words import WordError, Words

GIVEN_OR_NOT = (0.0, 1.0)
"""The values of each slot of an instruction in words."""


def worded(task: Task, words: Sequence[str], most_words: int | None = None) -> Task:
    """A task whose instructions are words.

    Where there are as many words as values that its rule gives, the rule gives the words, in the order of its values
    (or of its own words). Else the rule has nothing to say.

    Args:
        task: with numbers, or with words of its own.
        words: of whoever teaches; empty: those of the task.
        most_words: slots; None: as many as words.

    Raises:
        ConfigError: naming the setting, its value and what is allowed.
    """
    own = task.words
    if not words and own is None:
        raise ConfigError(f"instructor.max_words={most_words}: allowed beside instructor.words, which are not set")
    try:
        chosen = Words(words or own.names if own is not None else words, most_words)
    except WordError as error:
        raise ConfigError(str(error)) from None
    values = range(len(own.names)) if own is not None else task.instruction_values
    ruled = len(chosen.names) == len(values) and (own is not None or task.instruction_size == 1)
    rule = (
        InWords(task.rule, None if own is not None else tuple(values), len(chosen))
        if ruled
        else NothingToSay(len(chosen))
    )
    return replace(task, phrases=chosen, rule=rule, instruction_values=GIVEN_OR_NOT)


@dataclass(frozen=True)
class InWords:
    """A rule whose instructions are put into words.

    Args:
        rule: states ``(..., S)`` to numbers ``(..., 1)``, or to words already.
        values: the numbers, in the order of the words; None: the rule gives words.
        slots: of the instructions in words.
    """

    rule: Callable[[Array], Array]
    values: tuple[float, ...] | None
    slots: int

    def __call__(self, states: Array) -> Array:
        """States ``(..., S)`` to words ``(..., slots)``."""
        said = self.rule(states)
        if self.values is not None:
            said = np.isclose(said, np.array(self.values)).astype(np.float32)
        return np.concatenate([said, np.zeros((*said.shape[:-1], self.slots - said.shape[-1]), np.float32)], axis=-1)


@dataclass(frozen=True)
class NothingToSay:
    """The rule where the environment has none for these words: always silent."""

    slots: int

    def __call__(self, states: Array) -> Array:
        """States ``(..., S)`` to ``(..., slots)``, no word."""
        return np.zeros((*states.shape[:-1], self.slots), np.float32)


def has_rule(task: Task) -> bool:
    """Whether the environment's rule can say something in the words of the task."""
    return not isinstance(task.rule, NothingToSay)
