"""What a vocabulary says at many moments, what came of it, and how sure one could have been."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.evaluation.moments import Moments
from ibe_rl.explain.explainer import CONFIDENCE_FEATURES, majority_phrases
from ibe_rl.ibe import phrases_of
from ibe_rl.metrics import Calibration
from ibe_rl.task import Phrases
from ibe_rl.types import Array, Mapping


@dataclass(frozen=True)
class Spoken:
    """What one vocabulary says at ``N`` moments about one horizon.

    Attributes:
        expression: ``(N, d)`` of the first future alone, which the motion is judged by.
        true: ``(N,)`` bool, whether the vocabulary calls what really happened as it calls this future.
        phrase: ``(N,)`` what is said: the most frequent phrase among the futures.
        which: ``(N,)`` the first of the futures that is called so.
        said: ``(N, d)`` the expression of that one.
        voted_true: ``(N,)`` bool, whether it went as what is said predicts.
        agreement: ``(N,)`` share of the futures that are called so and that the predictor stands by.
        purity: ``(N,)`` the mapping's own confidence in it.
        known: ``(N,)`` bool, whether the meaning of what is said is known; if not, it is not said.
        first_known: ``(N,)`` the same of the first future.
    """

    expression: Array
    true: Array
    phrase: Array
    which: Array
    said: Array
    voted_true: Array
    agreement: Array
    purity: Array
    known: Array
    first_known: Array

    @property
    def features(self) -> Array:
        """``(N, 2)``, see ``CONFIDENCE_FEATURES``."""
        return np.column_stack([self.agreement, self.purity])


def speak(mapping: Mapping, moments: Moments, horizon_steps: int, words: Sequence[Phrases]) -> Spoken:
    """Put the futures of each moment and what really happened into words."""
    at = moments.at(horizon_steps)
    predicted, rows = moments.predicted[:, :, at], np.arange(len(moments))
    phrases, which, agreement = majority_phrases(predicted, mapping, words, moments.trusted[:, :, at])
    first, chosen = mapping.express(predicted[:, 0]), predicted[rows, which]
    real = phrases_of(mapping.express(moments.realised[:, at]), words)
    return Spoken(
        expression=first,
        true=phrases_of(first, words) == real,
        phrase=np.array(phrases),
        which=which,
        said=mapping.express(chosen),
        voted_true=np.array(phrases) == real,
        agreement=agreement,
        purity=mapping.confidence(chosen),
        known=mapping.knows(chosen),
        first_known=mapping.knows(predicted[:, 0]),
    )


def calibrate(spoken: Spoken) -> Calibration:
    """Learn how sure one can be, from moments of episodes that nothing else is judged on."""
    counted = spoken.known if spoken.known.any() else np.ones(len(spoken.known), bool)
    return Calibration.fit(spoken.features[counted], spoken.voted_true[counted], CONFIDENCE_FEATURES)
