"""Does the agent do as told? The way that an instruction asks for, the way that is said, and the way it went.

A way is a direction -1, 0 or 1 for each of the ``d`` numbers of an instruction, or one word of an instructor's own.
Shapes: ``N`` moments, ``m`` parts of a way: ``d``, or 1 for words.
"""

from __future__ import annotations

import numpy as np

from ibe_rl.ibe.word_meaning import top_words
from ibe_rl.metrics.quality import direction
from ibe_rl.task import Task
from ibe_rl.types import Array, ExpressionMapping


def ways_told(instructions: Array, task: Task) -> Array:
    """The ways ``(N, m)`` that instructions ``(N, d)`` ask for."""
    if task.words is not None:
        return top_words(instructions)[:, None]
    return np.sign(instructions).astype(int)


def ways_said(expressions: Array, task: Task) -> Array:
    """The ways ``(N, m)`` that the phrases of expressions ``(N, d)`` name: 0 where the phrase is the one for 0."""
    if task.words is not None:
        return top_words(expressions)[:, None]
    least = np.array([words.degrees[0][0] for words in task.phrases])
    return np.where(np.abs(expressions) >= least, np.sign(expressions), 0).astype(int)


def ways_gone(changes: Array, mapping: ExpressionMapping, task: Task) -> Array:
    """The ways ``(N, m)`` of real changes of the state ``(N, S)``.

    Numbers: along the explained dimensions, beyond their bands, as in ``motion_auc``; the vocabulary has no part in it.
    Words: the word of the change, which only the vocabulary knows.
    """
    if task.words is not None:
        return top_words(mapping.express(changes))[:, None]
    return direction(changes[:, list(task.explained)], np.array(task.explained_band))


def not_as_told(told: Array, ways: Array, counted: Array) -> Array:
    """Where ways ``(N, m)`` are not those told ``(N, m)``: ``(N,)`` 1 or 0, NaN where not ``counted`` ``(N,)``."""
    return np.where(counted, (told != ways).any(axis=1).astype(float), np.nan)
