"""Puts predictions into words: the expression of the change of the state, as the vocabulary has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ibe_rl.ibe.mapping import mean_movements
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.task import Phrases
from ibe_rl.task.words import Words
from ibe_rl.types import Array, Explanation, ExpressionMapping

CONFIDENCE_FEATURES = ("agreement", "purity")
"""Features of the calibrated confidence: the share of trusted futures with the spoken phrase, and
``ExpressionMapping.confidence``."""

AHEAD_STEPS = (0, 2, 4)
"""Where the windows begin that vote for a phrase. The later ones tell early of a change (docs/LOG.md)."""


@dataclass(frozen=True)
class Asking:
    """What else the agent is told at the moments that it explains.

    Attributes:
        values: that could be said, ``(d,)`` each, by name.
        every: only at every so many of the moments.
        futures: of each answer, at most as many as of the explanation; None: as many.
        calibration: of the confidence in the answers; None: not fitted.
    """

    values: Mapping[str, Array]
    every: int = 1
    futures: int | None = None
    calibration: Calibration | None = None

    def rows(self, moments: int, futures: int) -> list[int]:
        """Which futures have twins, of ``moments`` with so many ``futures`` each."""
        asked = self.futures_of(futures)
        return [first + row for first in range(0, moments * futures, self.every * futures) for row in range(asked)]

    def futures_of(self, futures: int) -> int:
        """The number of futures of an answer where an explanation has ``futures``."""
        return min(self.futures or futures, futures)


@dataclass(frozen=True)
class ExplainerState:
    """All that turns predictions into explanations at one time of the training.

    Attributes:
        mapping: the latest vocabulary.
        horizon_steps: n, the horizon it was learnt with.
        words: the environment's, one entry for each number of an expression.
        spans: further vocabularies by their horizon in steps.
        futures: number of roll-outs from each moment; the phrase of most of them is said.
        calibration: from ``CONFIDENCE_FEATURES`` to the probability that the phrase comes true. None: not fitted yet,
            the confidence is the product of the features.
        min_confidence: below it the agent says that it does not know.
        what_if: what else the agent is told; None: nothing.
    """

    mapping: ExpressionMapping
    horizon_steps: int
    words: Sequence[Phrases]
    spans: Mapping[int, ExpressionMapping] = field(default_factory=dict)
    futures: int = 1
    calibration: Calibration | None = None
    min_confidence: float = 0.0
    what_if: Asking | None = None


def put_in_words(paths: Array, explainer: ExplainerState, trusted_steps: Array | None = None) -> list[Explanation]:
    """Turn predictions into explanations.

    Args:
        paths: ``(N, F, H + 1, S)``, ``F`` futures of each moment.
        explainer: the vocabularies, words and calibration.
        trusted_steps: ``(N, F)``, see ``Prediction``; None: all of them.
    """
    if trusted_steps is None:
        trusted_steps = np.full(paths.shape[:2], paths.shape[2] - 1)
    said = _of_span(paths, trusted_steps, explainer)
    others = [
        _of_span(paths, trusted_steps, ExplainerState(mapping, steps, explainer.words))
        for steps, mapping in sorted(explainer.spans.items())
    ]
    return [replace(one, spans=tuple(other[row] for other in others)) for row, one in enumerate(said)]


def _of_span(paths: Array, trusted_steps: Array, explainer: ExplainerState) -> list[Explanation]:
    steps, mapping, calibration = explainer.horizon_steps, explainer.mapping, explainer.calibration
    later = [
        paths[:, :, ahead + steps] - paths[:, :, ahead] for ahead in AHEAD_STEPS[1:] if ahead + steps < paths.shape[2]
    ]
    paths, trusted_steps = paths[:, :, : steps + 1], np.minimum(trusted_steps, steps)
    deltas = paths[:, :, -1] - paths[:, :, 0]
    phrases, which, agreement = majority_phrases(deltas, mapping, explainer.words, trusted_steps >= steps)
    chosen = np.arange(len(deltas)), which
    spoken, spoken_paths, steps_trusted = deltas[chosen], paths[chosen], trusted_steps[chosen]
    features, meant = np.column_stack([agreement, mapping.confidence(spoken)]), mapping.knows(spoken)
    confidence = features.prod(axis=1) if calibration is None else calibration.probability(features)
    confidence = np.where(meant, confidence, 0.0)
    expressions, clusters = mapping.express(spoken), mapping.ids[mapping.cluster(spoken)]
    movements = mean_movements(mapping, deltas)
    return [
        Explanation(
            expression=expressions[row],
            phrase=phrase,
            cluster=int(clusters[row]),
            delta_state=spoken[row],
            horizon_steps=steps,
            confidence=float(confidence[row]),
            path=spoken_paths[row],
            futures=deltas[row],
            agreement=float(features[row, 0]),
            purity=float(features[row, 1]),
            known=bool(meant[row] and confidence[row] >= explainer.min_confidence),
            meant=bool(meant[row]),
            calibrated=calibration is not None,
            trusted_steps=int(steps_trusted[row]),
            in_words=isinstance(explainer.words, Words),
            later_futures=np.array([each[row] for each in later]).reshape(-1, deltas.shape[2]),
            trusted_share=float(np.mean(trusted_steps[row] >= steps)),
            movement=movements[row],
        )
        for row, phrase in enumerate(phrases)
    ]


def majority_phrases(
    deltas: Array, mapping: ExpressionMapping, words: Sequence[Phrases], trusted: Array | None = None
) -> tuple[list[str], Array, Array]:
    """The most frequent phrase among the futures of each moment; the first one of equally frequent ones.

    Args:
        deltas: ``(N, F, S)`` changes of the state in ``F`` futures.
        mapping: the vocabulary.
        words: the environment's.
        trusted: ``(N, F)`` bool, futures that the predictor trusts; None: all of them.

    Returns:
        ``N`` phrases, the index ``(N,)`` of the first future with each, and the share ``(N,)`` of futures that have it
        and are trusted.
    """
    count, futures, size = deltas.shape
    called = phrases_of(mapping.express(deltas.reshape(-1, size)), words).reshape(count, futures)
    alike = called[:, :, None] == called[:, None]
    which = np.argmax(alike.sum(axis=2), axis=1)
    rows = np.arange(count)
    votes = alike[rows, which] if trusted is None else alike[rows, which] & trusted
    return called[rows, which].tolist(), which, votes.sum(axis=1) / futures


def confidence_features(said: Sequence[Explanation]) -> Array:
    """``(N, 2)``, see ``CONFIDENCE_FEATURES``."""
    return np.array([(one.agreement, one.purity) for one in said])


def reworded(said: Sequence[Explanation], explainer: ExplainerState) -> list[Explanation]:
    """The same predictions in the words of another vocabulary, without other spans."""
    futures, mapping = np.stack([one.futures for one in said]), explainer.mapping
    phrases, which, agreement = majority_phrases(futures, mapping, explainer.words)
    spoken = futures[np.arange(len(futures)), which]
    expressions, clusters = mapping.express(spoken), mapping.ids[mapping.cluster(spoken)]
    movements = mean_movements(mapping, futures)
    meant, purity = mapping.knows(spoken), mapping.confidence(spoken)
    return [
        replace(
            one,
            expression=expressions[row],
            phrase=phrases[row],
            cluster=int(clusters[row]),
            delta_state=spoken[row],
            agreement=float(agreement[row]),
            purity=float(purity[row]),
            meant=bool(meant[row]),
            movement=movements[row],
            spans=(),
        )
        for row, one in enumerate(said)
    ]


def hold(said: Sequence[Explanation], every_steps: int, steps: int) -> list[Explanation]:
    """Repeat each explanation for ``every_steps`` steps, ``steps`` in all."""
    return [said[step // every_steps] for step in range(steps)]
