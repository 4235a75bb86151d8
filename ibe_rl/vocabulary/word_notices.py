"""What the agent notices about an instructor's words at a refresh."""

from __future__ import annotations

import numpy as np

from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.word_meaning import moves_of
from ibe_rl.task.words import Words
from ibe_rl.types import Array
from ibe_rl.vocabulary.words import MEANS_NOTHING, MEANS_OTHER, MEANS_SAME, WordNotice

STILL_LIKE = 0.3
"""Correlation of a word's share before and now, over the newest best movements: below, its meaning has changed."""


def notices_of(
    mapping: ClusterMapping, delta: Array, last: ClusterMapping | None, words: Words | None
) -> list[WordNotice]:
    """What is to be told about the words of a newly learnt vocabulary.

    Args:
        mapping: the newest one.
        delta: ``(W, S)`` movements of the best episodes.
        last: the vocabulary before; None at the first refresh.
        words: of the instructor; None where it gives numbers, which nothing is noticed of.
    """
    if words is None:
        return []
    found = _nothing_yet(mapping, words)
    found += [
        WordNotice(MEANS_SAME, pair, f"you use '{words.names[pair[0]]}' and '{words.names[pair[1]]}' alike")
        for pair in same_words(mapping, len(words.names))
    ]
    return found + ([] if last is None else _changed(last, mapping, np.asarray(delta), words))


def _nothing_yet(mapping: ClusterMapping, words: Words) -> list[WordNotice]:
    known = [one.known for one in mapping.meanings]
    reasons = {slot: mapping.meanings[slot].reason for slot in range(len(words.names)) if not known[slot]}
    return [
        WordNotice(MEANS_NOTHING, (slot,), f"'{words.names[slot]}' means nothing to me yet: {reason}")
        for slot, reason in reasons.items()
    ]


def same_words(mapping: ClusterMapping, count: int) -> list[tuple[int, int]]:
    """Pairs of words that are used alike, so that one is spoken for both."""
    stands_in = [(slot, mapping.meanings[slot].same_as) for slot in range(count)]
    return [(min(slot, other), max(slot, other)) for slot, other in stands_in if other is not None]


def _changed(last: ClusterMapping, mapping: ClusterMapping, delta: Array, words: Words) -> list[WordNotice]:
    if moves_of(last.meanings) is None or last.expressions.shape != (len(last.ids), mapping.expressions.shape[1]):
        return []
    before, now = last.express(delta), mapping.express(delta)
    found = []
    for slot, word in enumerate(words.names):
        both_known = last.meanings[slot].known and mapping.meanings[slot].known
        if both_known and _correlation(before[:, slot], now[:, slot]) < STILL_LIKE:
            found.append(WordNotice(MEANS_OTHER, (slot,), f"'{word}' no longer means what it meant before"))
    return found


def _correlation(one: Array, other: Array) -> float:
    """Of two columns; 1 where one of them is constant, as a word that is not spoken is."""
    if np.ptp(one) == 0 or np.ptp(other) == 0:
        return 1.0
    return float(np.corrcoef(one, other)[0, 1])
