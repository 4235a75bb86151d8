"""What moved since the last refresh: the vocabulary on fixed windows, the policy in fixed states."""

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
    """How far one mapping lies from another, on the same windows.

    Attributes:
        phrase_changed: share of the windows that are called something else.
        expression_moved: mean distance of their expressions, in [0, 2]; with d numbers up to 2 sqrt(d).
        cluster_agreement: adjusted Rand index of the clusters; 1 if they group the windows alike.
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
"""Of all that a number of a continuous action varies over: nearer than this it is the same action."""


def policy_drift(before: Array, after: Array) -> float:
    """Share of the same states ``(P, ...)`` in which another action is taken than before.

    Continuous actions differ at least a little everywhere. One counts as another if one of its numbers has moved by
    more than a tenth of the range that this number takes over all these states, before and after.
    """
    moved = before != after
    if np.issubdtype(after.dtype, np.floating):
        both = np.concatenate([before, after])
        moved = np.abs(after - before) > MOVED_BY * np.ptp(both, axis=0)
    return float(np.mean(np.any(moved.reshape(len(before), -1), axis=1)))
