"""What each word of an instructor means as movement: how the state changed after it, and whether that tells it apart.

An expression in words is the share of each of the ``d`` words, from 0 to 1; an instruction has 1 for its word.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import rankdata

from ibe_rl.ibe.delta import Windows
from ibe_rl.ibe.meaning import Meaning
from ibe_rl.types import Array, ExpressionMapping

MIN_HEARD = 20
"""Windows with a word, for its meaning to be known."""
TELLING_AUC = 0.6
"""Of a word's share for whether it was said, on episodes that the shares are not of: below, it means nothing."""


def word_meanings(windows: Windows, labels: Array, centres: int) -> tuple[Meaning, ...]:
    """What is known of each word.

    Args:
        windows: of the best episodes, each with a word.
        labels: ``(W,)`` the cluster of each window.
        centres: how many clusters there are.

    Returns:
        For each of the ``d`` slots a ``Meaning`` with the ``moves`` of its word; ``positive`` is whether it is known.
    """
    said, deltas = windows.instruction.argmax(axis=1), np.asarray(windows.delta, float)
    heard = np.asarray(windows.instruction) > 0
    spread, overall = deltas.std(axis=0), deltas.mean(axis=0)
    episodes = len(np.unique(windows.episode))
    telling = _telling(labels, said, windows.episode % 2 == 0, centres, windows.instruction.shape[1])
    found = []
    for slot, count in enumerate(heard.sum(axis=0).tolist()):
        moves = deltas[heard[:, slot]].mean(axis=0) if count else np.zeros(deltas.shape[1])
        rises = np.divide(moves - overall, spread, out=np.zeros_like(spread), where=spread > 0) * (count > 0)
        reason = _why_unknown(count, telling[slot])
        found.append(
            Meaning(
                negative=True,
                positive=not reason,
                reason=reason,
                episodes=episodes,
                direction=tuple((rises / (np.abs(rises).max() or 1.0)).tolist()),
                moves=tuple(moves.tolist()),
            )
        )
    return tuple(found)


def _why_unknown(count: int, telling: float) -> str:
    """Why the meaning of a word is unknown; empty if it is known."""
    if count < MIN_HEARD:
        return f"heard at {count} steps, too few" if count else "not heard yet"
    return "" if telling >= TELLING_AUC else "what I do after it is what I do after the others"


def _telling(labels: Array, said: Array, even: Array, centres: int, slots: int) -> list[float]:
    """How well the clusters tell each word from the others: shares of half of the episodes, AUC on the other half."""
    aucs = np.zeros((2, slots))
    for half, learnt in enumerate((even, ~even)):
        shares = balanced_shares(labels[learnt], said[learnt], centres, slots)[labels[~learnt]]
        aucs[half] = [auc_of(shares[:, slot], said[~learnt] == slot) for slot in range(slots)]
    return aucs.mean(axis=0).tolist()


def balanced_shares(labels: Array, said: Array, centres: int, slots: int, weight: Array | None = None) -> Array:
    """The share ``(k, d)`` of each word in each cluster, as if all words were said equally often.

    A cluster without windows has the same share of all words that are said at all.
    """
    counts = np.zeros((centres, slots))
    np.add.at(counts, (labels, said), 1.0 if weight is None else weight)
    often = counts.sum(axis=0)
    evenly = np.divide(counts, often, out=np.zeros_like(counts), where=often > 0)
    total = evenly.sum(axis=1, keepdims=True)
    return np.where(total > 0, evenly / np.where(total > 0, total, 1), (often > 0) / max(1, int((often > 0).sum())))


def auc_of(score: Array, positive: Array) -> float:
    """AUC of scores ``(N,)`` for positives ``(N,)`` bool; .5 where all or none are."""
    count = int(positive.sum())
    if count in (0, len(positive)):
        return 0.5
    ranks = rankdata(score)[positive].sum()
    return float((ranks - count * (count + 1) / 2) / (count * (len(positive) - count)))


def expected_motion(mapping: ExpressionMapping | None, expressions: Array, explained: Sequence[int]) -> Array:
    """The movement that expressions let expect, ``(N, m)`` along the ``m`` explained dimensions.

    For numbers it is the expression itself. For words it is the mean movement after them, weighted by their shares, in
    units of the largest movement after any word: what a listener expects who has seen how the words were used.
    """
    moves = moves_of(getattr(mapping, "meanings", ()))
    if moves is None:
        return expressions
    along, shares = moves[:, list(explained)], np.asarray(expressions, float)
    total = np.abs(shares.sum(axis=1, keepdims=True))
    evenly = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0)
    largest = np.abs(along).max(axis=0)
    scaled: Array = evenly @ along / np.where(largest > 0, largest, 1)
    return scaled


def asked_motion(
    mapping: ExpressionMapping | None, instruction: Array, explained: Sequence[int], band: Sequence[float]
) -> Array:
    """The directions -1, 0 or 1 that instructions ``(N, d)`` ask for along the ``m`` explained dimensions, ``(N, m)``.

    Numbers stay as they are. A word asks for the direction in which the state mostly went after it.
    """
    moves = moves_of(getattr(mapping, "meanings", ()))
    if moves is None:
        return instruction
    along = np.asarray(instruction) @ moves[:, list(explained)]
    ways: Array = np.where(np.abs(along) > np.asarray(band), np.sign(along), 0.0)
    return ways


def top_words(expressions: Array) -> Array:
    """The slot ``(N,)`` of the word with the largest share in each expression ``(N, d)``."""
    return np.asarray(expressions).argmax(axis=1)


def moves_of(meanings: Sequence[Meaning]) -> Array | None:
    """The mean movement ``(d, S)`` after each word; None for meanings of numbers."""
    return np.array([one.moves for one in meanings]) if meanings and meanings[0].moves else None
