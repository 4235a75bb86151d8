"""Explanations of a vocabulary at many moments, their outcomes, and the calibration of the confidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.evaluation.moments import Moments, Spoken
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, majority_phrases
from ibe_rl.ibe.mapping import mean_movements
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.ibe.word_meaning import top_words
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.task import Phrases
from ibe_rl.types import ExpressionMapping


def speak(mapping: ExpressionMapping, moments: Moments, horizon_steps: int, words: Sequence[Phrases]) -> Spoken:
    """Express the sampled futures and the real change of each moment in words."""
    at = moments.at(horizon_steps)
    predicted, rows = moments.predicted[:, :, at], np.arange(len(moments))
    phrases, which, agreement = majority_phrases(predicted, mapping, words, moments.trusted[:, :, at])
    first, chosen = mapping.express(predicted[:, 0]), predicted[rows, which]
    realised = mapping.express(moments.realised[:, at])
    real = phrases_of(realised, words)
    return Spoken(
        expression=mean_movements(mapping, predicted),
        true=phrases_of(first, words) == real,
        phrase=np.array(phrases),
        which=which,
        said=mapping.express(chosen),
        voted_true=np.array(phrases) == real,
        agreement=agreement,
        purity=mapping.confidence(chosen),
        known=mapping.knows(chosen),
        first_known=mapping.knows(predicted[:, 0]),
        word=top_words(first),
        real_word=top_words(realised),
        told_word=top_words(moments.instruction),
    )


def calibrate(spoken: Spoken) -> Calibration:
    """Calibrate the confidence on moments of held-out episodes."""
    counted = spoken.known if spoken.known.any() else np.ones(len(spoken.known), bool)
    return Calibration.fit(spoken.features[counted], spoken.voted_true[counted], CONFIDENCE_FEATURES)
