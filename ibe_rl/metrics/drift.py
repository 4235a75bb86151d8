"""Change since the last refresh: of the vocabulary on fixed windows, of the policy in fixed states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.metrics import adjusted_rand_score

from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.task import Phrases
from ibe_rl.types import Array, ExpressionMapping


@dataclass(frozen=True)
class VocabularyDrift:
    """Difference of two mappings on the same windows.

    Attributes:
        phrase_changed: share of the windows with another phrase.
        expression_moved: mean distance of their expressions, in [0, 2]; with d numbers up to 2 sqrt(d).
        cluster_agreement: adjusted Rand index of the clusters; 1 if both group the windows alike.
    """

    phrase_changed: float
    expression_moved: float
    cluster_agreement: float


def vocabulary_drift(
    before: ExpressionMapping, after: ExpressionMapping, probe: Array, words: Sequence[Phrases]
) -> VocabularyDrift:
    """Compare two mappings on fixed changes of the state ``(P, S)``."""
    expressions = [mapping.express(probe) for mapping in (before, after)]
    spoken = [phrases_of(each, words) for each in expressions]
    return VocabularyDrift(
        phrase_changed=float(np.mean(spoken[0] != spoken[1])),
        expression_moved=float(np.mean(np.linalg.norm(expressions[0] - expressions[1], axis=1))),
        cluster_agreement=float(adjusted_rand_score(before.cluster(probe), after.cluster(probe))),
    )


MOVED_BY = 0.1
"""Threshold of another continuous action, as a share of the range of each number."""


def policy_drift(before: Array, after: Array) -> float:
    """Share of the states in which the action differs, from the actions ``(P, ...)`` before and after.

    A continuous action counts as different if any of its numbers has moved by more than a tenth of that number's range
    over all these states, before and after.
    """
    moved = before != after
    if np.issubdtype(after.dtype, np.floating):
        both = np.concatenate([before, after])
        moved = np.abs(after - before) > MOVED_BY * np.ptp(both, axis=0)
    return float(np.mean(np.any(moved.reshape(len(before), -1), axis=1)))
