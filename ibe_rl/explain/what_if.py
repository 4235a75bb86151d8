"""What the agent would do if it were told something else: answers for each value that could be said.

The answers are explanations of twins of the moment's futures, which are told one value until their end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.task import Task
from ibe_rl.types import Array, Explanation, Moment

Values = Mapping[str, Array]
"""Values ``(d,)`` that could be said, by name."""
MOST_VALUES = 12
"""Of all combinations of several numbers; where there are more, each number is asked alone, the others 0."""


def values_of(task: Task) -> dict[str, Array]:
    """The values that an environment declares, called by its own phrases; or the words of whoever teaches."""
    if task.words is not None:
        return {word: task.words.one_hot(slot) for slot, word in enumerate(task.words.names)}
    each, numbers = task.instruction_values, task.instruction_size
    rows = [*product(each, repeat=numbers)] if len(each) ** numbers <= MOST_VALUES else _one_at_a_time(each, numbers)
    values = [np.array(row, np.float32) for row in rows]
    names = [phrase(value, task.phrases) for value in values]
    marked = [
        name if names.count(name) == 1 else f"{name} ({', '.join(f'{one:g}' for one in value)})"
        for name, value in zip(names, values, strict=True)
    ]
    return dict(zip(marked, values, strict=True))


def _one_at_a_time(each: Sequence[float], numbers: int) -> list[tuple[float, ...]]:
    alone = [tuple(value * (at == number) for at in range(numbers)) for number in range(numbers) for value in each]
    return [*dict.fromkeys(tuple(one + 0.0 for one in row) for row in alone)]


def told_twins(futures: Sequence[Moment], values: Values, rows: Sequence[int] | None = None) -> list[Moment]:
    """The twins of futures, to be rolled out behind them: those with the first value, then those with the second, ...

    Args:
        futures: the moments that are rolled out.
        values: that the twins are told.
        rows: of the futures that have twins; None: all.
    """
    asked = range(len(futures)) if rows is None else rows
    return [
        replace(futures[row], instruction=value, given=True, twin=row) for value in values.values() for row in asked
    ]


def listening(expressions: Array, values: Array) -> Array:
    """How much the agent listens: the spread of its answers relative to that of what it is told.

    Args:
        expressions: ``(..., W, d)`` of its answers.
        values: ``(W, d)`` that it is told.

    Returns:
        ``(...)`` in [0, 1], the mean over the numbers that vary in ``values``: 0 where all answers are the same, 1
        where it answers as it is told. NaN where nothing varies.

    >>> listening(np.array([[-0.5], [0.0], [0.5]]), np.array([[-1.0], [0.0], [1.0]])).item()
    0.5
    """
    asked = np.ptp(values, axis=0)
    varied = asked > 0
    if not varied.any():
        return np.full(expressions.shape[:-2], np.nan)
    answered = np.ptp(expressions[..., varied], axis=-2)
    return np.asarray(np.minimum(answered / asked[varied], 1.0).mean(axis=-1))


def with_answers(
    said: Sequence[Explanation], answers: Sequence[Explanation], values: Values, every: int = 1
) -> list[Explanation]:
    """Explanations with the answers at every so many of them.

    Args:
        said: of ``N`` moments.
        answers: to the first value at all moments that were asked, then to the second, ...
        values: the ``W`` values.
        every: only every so many moments were asked.
    """
    asked, found = range(0, len(said), every), list(said)
    by_value = [answers[start : start + len(asked)] for start in range(0, len(answers), len(asked))]
    for row, of_moment in zip(asked, zip(*by_value, strict=True), strict=True):
        expressions = np.array([one.expression for one in of_moment])
        listens = float(listening(expressions, np.array([*values.values()])))
        found[row] = replace(said[row], what_if=dict(zip(values, of_moment, strict=True)), listens=listens)
    return found


def whatever(said: Explanation) -> str | None:
    """What it does whatever it is told; None if that depends, if it was not asked, or if it does not know."""
    answers = {one.phrase for one in said.what_if.values() if one.known}
    everywhere = all(one.known for one in said.what_if.values())
    return answers.pop() if len(said.what_if) > 1 and len(answers) == 1 and everywhere else None


def in_a_sentence(said: Explanation, short: Callable[[str], str] = str) -> str:
    """The answers at one moment, values with the same answer together; empty if it was not asked.

    Args:
        said: the explanation.
        short: shortens phrases.
    """
    if not said.what_if:
        return ""
    if (same := whatever(said)) is not None:
        return f"whatever you say now: {short(same)}"
    return together([*map(short, said.what_if)], [short(one.said) for one in said.what_if.values()])


def together(names: Sequence[str], answers: Sequence[str]) -> str:
    """Values with the same answer, listed together.

    >>> together(["left", "right", "up"], ["left", "down", "left"])
    'told left or up: left; told right: down'
    """
    if len(set(answers)) == 1:
        return f"whatever it is told: {answers[0]}"
    told_for = {answer: [name for name, one in zip(names, answers, strict=True) if one == answer] for answer in answers}
    return "; ".join(f"told {' or '.join(values)}: {answer}" for answer, values in told_for.items())
