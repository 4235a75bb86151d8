"""What the agent says: roll out the policy, look up the expression of the change of the state, put it into words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ibe_rl.explain.what_if import Asking, told_twins, with_answers
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.quality import realised_phrases
from ibe_rl.task import Phrases
from ibe_rl.task.words import Words
from ibe_rl.types import Array, Episode, Explanation, ExpressionMapping, Moment, Policy, Prediction, Predictor

CONFIDENCE_FEATURES = ("agreement", "purity")
"""Features of the calibrated confidence: the share of trusted futures with the spoken phrase, and
``ExpressionMapping.confidence``."""


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


def explain(
    moments: Sequence[Moment], policy: Policy, predictor: Predictor, explainer: ExplainerState
) -> list[Explanation]:
    """Explain the agent's future at each of ``N`` moments (the paper's Algorithm 1 and equation 2).

    All moments are predicted in one roll-out with the greedy ``policy``. In it is also what it would do if it were told
    something else (``explainer.what_if``), with the same chance events.

    Returns:
        ``N`` explanations of the next ``explainer.horizon_steps`` steps, each with those of the other horizons.
    """
    if not moments:
        return []
    longest, asking = max([explainer.horizon_steps, *explainer.spans]), explainer.what_if
    futures = [moment for moment in moments for _ in range(explainer.futures)]
    twins = told_twins(futures, asking.values, asking.rows(len(moments), explainer.futures)) if asking else []
    predicted = predictor.rollout([*futures, *twins], policy, longest)
    said = put_in_words(*_by_moment(predicted, slice(len(futures)), explainer.futures, explainer))
    if asking is None:
        return said
    answering = replace(explainer, spans={}, calibration=asking.calibration, what_if=None)
    several = asking.futures_of(explainer.futures)
    answers = put_in_words(*_by_moment(predicted, slice(len(futures), None), several, answering))
    return with_answers(said, answers, asking.values, asking.every)


def _by_moment(
    predicted: Prediction, rows: slice, futures: int, explainer: ExplainerState
) -> tuple[Array, ExplainerState, Array]:
    """Some rows of a prediction as the arguments of ``put_in_words``, with so many futures each."""
    paths, trusted_steps = predicted.paths[rows], predicted.trusted_steps[rows]
    return paths.reshape(-1, futures, *paths.shape[1:]), explainer, trusted_steps.reshape(-1, futures)


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
    paths, trusted_steps = paths[:, :, : steps + 1], np.minimum(trusted_steps, steps)
    deltas = paths[:, :, -1] - paths[:, :, 0]
    phrases, which, agreement = majority_phrases(deltas, mapping, explainer.words, trusted_steps >= steps)
    chosen = np.arange(len(deltas)), which
    spoken, spoken_paths, steps_trusted = deltas[chosen], paths[chosen], trusted_steps[chosen]
    features, meant = np.column_stack([agreement, mapping.confidence(spoken)]), mapping.knows(spoken)
    confidence = features.prod(axis=1) if calibration is None else calibration.probability(features)
    confidence = np.where(meant, confidence, 0.0)
    expressions, clusters = mapping.express(spoken), mapping.ids[mapping.cluster(spoken)]
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


def phrase_hits_in(
    mapping: ExpressionMapping, episode: Episode, said: Sequence[Explanation], words: Sequence[Phrases]
) -> Array:
    """As ``metrics.phrase_hits``, ``(T,)``, but of the phrases of another vocabulary for the same futures."""
    futures = np.stack([one.futures for one in said])
    phrases, which, _ = majority_phrases(futures, mapping, words)
    same = np.array(phrases) == np.array(realised_phrases(episode, said[0].horizon_steps, mapping, words))
    return np.where(mapping.knows(futures[np.arange(len(futures)), which]), same, np.nan)


def confidence_features(said: Sequence[Explanation]) -> Array:
    """``(N, 2)``, see ``CONFIDENCE_FEATURES``."""
    return np.array([(one.agreement, one.purity) for one in said])


def hold(said: Sequence[Explanation], every_steps: int, steps: int) -> list[Explanation]:
    """Repeat each explanation for ``every_steps`` steps, ``steps`` in all."""
    return [said[step // every_steps] for step in range(steps)]
