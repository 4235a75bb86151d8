"""What a vocabulary says at many moments, what came of it, and how sure one could have been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.data import Array, Mapping, Phrases
from ibe_rl.evaluation.moments import Moments
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.drift import phrases_of

FEATURES = ("agreement", "purity")
"""What the confidence is calibrated from: ``Spoken.agreement`` and the mapping's own, uncalibrated confidence."""


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
        """``(N, 2)``, see ``FEATURES``."""
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
    return Spoken(
        expression=expressions.reshape(count, futures, -1)[:, 0],
        phrase=first,
        true=first == real,
        voted_true=most_frequent(phrases) == real,
        agreement=np.mean(phrases == first[:, None], axis=1),
        purity=mapping.confidence(predicted[:, 0]),
    )


def most_frequent(phrases: Array) -> Array:
    """The most frequent phrase ``(N,)`` of each row of ``(N, F)``; of equally frequent ones, the one said first."""
    counts = np.sum(phrases[:, :, None] == phrases[:, None, :], axis=2)
    return phrases[np.arange(len(phrases)), counts.argmax(axis=1)]


def calibrate(spoken: Spoken) -> Calibration:
    """Learn how sure one can be, from moments of episodes that nothing else is judged on."""
    return Calibration.fit(spoken.features, spoken.true, FEATURES)
