"""What a vocabulary says at many moments, what came of it, and how sure one could have been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.data import Array, Mapping, Phrases
from ibe_rl.evaluation.moments import Moments
from ibe_rl.explainer import CONFIDENCE_FEATURES, voted
from ibe_rl.ibe import phrases_of
from ibe_rl.metrics import Calibration


@dataclass(frozen=True)
class Spoken:
    """What one vocabulary says at ``N`` moments about one horizon.

    Attributes:
        expression: ``(N, d)`` of the first future.
        phrase: ``(N,)`` the same in words.
        true: ``(N,)`` bool, whether the vocabulary calls what really happened the same.
        voted_true: ``(N,)`` the same of the most frequent phrase among the futures.
        agreement: ``(N,)`` share of the futures that carry the spoken phrase.
        purity: ``(N,)`` the mapping's own confidence.
    """

    expression: Array
    phrase: Array
    true: Array
    voted_true: Array
    agreement: Array
    purity: Array

    @property
    def features(self) -> Array:
        """``(N, 2)``, see ``CONFIDENCE_FEATURES``."""
        return np.column_stack([self.agreement, self.purity])


def speak(mapping: Mapping, moments: Moments, horizon_steps: int, words: Sequence[Phrases]) -> Spoken:
    """Put the futures of each moment and what really happened into words."""
    at = moments.at(horizon_steps)
    predicted, count = moments.predicted[:, :, at], len(moments)
    futures = predicted.shape[1]
    expressions = mapping.express(predicted.reshape(count * futures, -1))
    phrases = phrases_of(expressions, words).reshape(count, futures)
    real = phrases_of(mapping.express(moments.realised[:, at]), words)
    first = phrases[:, 0]
    most = first if futures == 1 else np.array(voted(predicted, mapping, words)[0])
    return Spoken(
        expression=expressions.reshape(count, futures, -1)[:, 0],
        phrase=first,
        true=first == real,
        voted_true=most == real,
        agreement=np.mean(phrases == first[:, None], axis=1),
        purity=mapping.confidence(predicted[:, 0]),
    )


def calibrate(spoken: Spoken) -> Calibration:
    """Learn how sure one can be, from moments of episodes that nothing else is judged on."""
    return Calibration.fit(spoken.features, spoken.true, CONFIDENCE_FEATURES)
