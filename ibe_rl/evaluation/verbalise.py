"""What a vocabulary says at many moments, what came of it, and how sure one could have been."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.evaluation.moments import Moments, Spoken
from ibe_rl.explain.explainer import CONFIDENCE_FEATURES, majority_phrases
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.task import Phrases
from ibe_rl.types import ExpressionMapping


def speak(mapping: ExpressionMapping, moments: Moments, horizon_steps: int, words: Sequence[Phrases]) -> Spoken:
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
