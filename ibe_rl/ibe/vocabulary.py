"""From mean instructions to expressions, and from expressions to phrases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.task.words import Phrases, Words
from ibe_rl.types import Array

NORMALISATIONS = ("minmax", "sign")
BETWEEN_FROM, A_LITTLE_FROM = 2 / 3, 1 / 3
"""Share of another word, relative to the largest, from which a movement is between both, or only a little the first."""
NO_WORD = "no word for it"


def normalise(mean_instructions: Array, how: str = "minmax") -> Array:
    """Normalise the mean instructions between the clusters (the paper: "normalize e^i ... to be m^i").

    Args:
        mean_instructions: ``(k, d)`` e^i.
        how: "minmax" scales each column to [-1, 1], or to 0 if its values are equal. "sign" divides it by its largest
            magnitude, which keeps every sign.

    Returns:
        ``(k, d)`` m^i in [-1, 1].

    Raises:
        ValueError: for another ``how``.
    """
    if how == "minmax":
        low, high = mean_instructions.min(axis=0), mean_instructions.max(axis=0)
        spread, centred = high - low, 2 * mean_instructions - high - low
    elif how == "sign":
        spread, centred = np.abs(mean_instructions).max(axis=0), mean_instructions
    else:
        raise ValueError(f"normalisation={how!r}: choose one of {', '.join(NORMALISATIONS)}")
    return np.clip(np.divide(centred, spread, out=np.zeros_like(centred), where=spread > 0), -1, 1)


def phrase(expression: Array, vocabulary: Sequence[Phrases]) -> str:
    """The phrase for an expression ``(d,)``, in the words of the environment or of whoever teaches.

    >>> falling = Phrases("straight down", "{degree}left", "{degree}right", ((0.2, "slightly "), (0.5, "")))
    >>> phrase(np.array([0.3]), [falling]), phrase(np.array([-0.9]), [falling])
    ('slightly right', 'left')
    """
    if isinstance(vocabulary, Words):
        return in_own_words(expression, vocabulary)
    return " and ".join(_words(float(value), words) for value, words in zip(expression, vocabulary, strict=True))


def in_own_words(expression: Array, words: Words) -> str:
    """The phrase for an expression ``(d,)`` in words: one word, a little of it, or between words of like shares.

    >>> words = Words(["links", "halt", "rechts"])
    >>> [in_own_words(np.array(one), words) for one in ([0.9, 0.1, 0], [0.6, 0.3, 0.1], [0.5, 0.4, 0.1])]
    ['links', "a little 'links'", "between 'links' and 'halt'"]
    """
    shares = np.asarray(expression, float)[: len(words.names)]
    top = int(np.argmax(shares))
    if not shares[top] > 0:
        return NO_WORD
    close = [f"'{words.names[slot]}'" for slot in np.flatnonzero(shares >= BETWEEN_FROM * shares[top] - 1e-9).tolist()]
    if len(close) > 1:
        return f"between {', '.join(close[:-1])} and {close[-1]}"
    second = float(np.delete(shares, top).max(initial=0))
    return f"a little {close[0]}" if second > A_LITTLE_FROM * shares[top] else words.names[top]


def phrases_of(expressions: Array, vocabulary: Sequence[Phrases]) -> Array:
    """The phrases ``(N,)`` for expressions ``(N, d)``."""
    distinct, rows = np.unique(expressions, axis=0, return_inverse=True)
    return np.array([phrase(expression, vocabulary) for expression in distinct])[rows]


def _words(value: float, words: Phrases) -> str:
    degree = None
    for limit, word in words.degrees:
        if abs(value) >= limit:
            degree = word
    if degree is None:
        return words.zero
    return (words.positive if value > 0 else words.negative).format(degree=degree)
