"""What the agent says: roll out, take the change of the state, look up its expression, put it in words."""

from __future__ import annotations

from collections.abc import Mapping as Dict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ibe_rl.ibe import phrases_of
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.quality import realised_phrases
from ibe_rl.task import Phrases
from ibe_rl.types import Array, Episode, Explanation, Mapping, Moment, Policy, Predictor

CONFIDENCE_FEATURES = ("agreement", "purity")
"""What the confidence is calibrated from: the share of the futures that are trusted and have the spoken phrase,
``Mapping.confidence``."""


@dataclass(frozen=True)
class Voice:
    """What an agent speaks with.

    Attributes:
        mapping: the vocabulary as last learnt.
        horizon_steps: n, the one it was learnt with.
        words: of the environment, one entry for each number of an expression.
        spans: the vocabularies of other spans of time, by their horizon in steps.
        futures: how many are sampled at each moment; what most of them would be called is said.
        calibration: from ``CONFIDENCE_FEATURES`` to the probability that it goes as predicted; None: not known yet,
            the confidence is the product of the features.
        min_confidence: under it the agent says that it does not know.
    """

    mapping: Mapping
    horizon_steps: int
    words: Sequence[Phrases]
    spans: Dict[int, Mapping] = field(default_factory=dict)
    futures: int = 1
    calibration: Calibration | None = None
    min_confidence: float = 0.0


def explain(moments: Sequence[Moment], policy: Policy, predictor: Predictor, voice: Voice) -> list[Explanation]:
    """Explain the agent's future at each moment (the paper's Algorithm 1 and equation 2).

    Args:
        moments: ``N`` moments, all of them predicted together.
        policy: the greedy policy.
        predictor: where it leads.
        voice: what is spoken with.

    Returns:
        ``N`` explanations of the next ``voice.horizon_steps`` steps, each with those of the other spans of time.
    """
    if not moments:
        return []
    longest = max([voice.horizon_steps, *voice.spans])
    futures = [moment for moment in moments for _ in range(voice.futures)]
    predicted, shape = predictor.rollout(futures, policy, longest), (len(moments), voice.futures)
    paths = predicted.paths.reshape(*shape, *predicted.paths.shape[1:])
    return put_in_words(paths, voice, predicted.trusted_steps.reshape(shape))


def put_in_words(paths: Array, voice: Voice, trusted_steps: Array | None = None) -> list[Explanation]:
    """Say what predictions are called.

    Args:
        paths: ``(N, F, H + 1, S)``, ``F`` futures of each moment.
        voice: what is spoken with.
        trusted_steps: ``(N, F)``, see ``Prediction``; None: all of them.
    """
    if trusted_steps is None:
        trusted_steps = np.full(paths.shape[:2], paths.shape[2] - 1)
    said = _of_span(paths, trusted_steps, voice)
    others = [
        _of_span(paths, trusted_steps, Voice(mapping, steps, voice.words))
        for steps, mapping in sorted(voice.spans.items())
    ]
    return [replace(one, spans=tuple(other[row] for other in others)) for row, one in enumerate(said)]


def _of_span(paths: Array, trusted_steps: Array, voice: Voice) -> list[Explanation]:
    steps = voice.horizon_steps
    paths, trusted_steps = paths[:, :, : steps + 1], np.minimum(trusted_steps, steps)
    deltas = paths[:, :, -1] - paths[:, :, 0]
    phrases, which, agreement = voted(deltas, voice.mapping, voice.words, trusted_steps >= steps)
    rows = np.arange(len(deltas))
    spoken = deltas[rows, which]
    purity = voice.mapping.confidence(spoken)
    mapping = voice.mapping
    columns = (mapping.express(spoken), mapping.ids[mapping.cluster(spoken)], agreement, purity, mapping.knows(spoken))
    said = [
        Explanation(
            expression=expression,
            phrase=phrases[row],
            cluster=int(cluster),
            delta_state=spoken[row],
            horizon_steps=voice.horizon_steps,
            confidence=float(agreed * pure),
            path=paths[row, which[row]],
            futures=deltas[row],
            agreement=float(agreed),
            purity=float(pure),
            trusted_steps=int(trusted_steps[row, which[row]]),
            meant=bool(meant),
            calibrated=voice.calibration is not None,
        )
        for row, (expression, cluster, agreed, pure, meant) in enumerate(zip(*columns, strict=True))
    ]
    return _sure(said, voice)


def voted(
    deltas: Array, mapping: Mapping, words: Sequence[Phrases], trusted: Array | None = None
) -> tuple[list[str], Array, Array]:
    """What most of the futures of each moment are called.

    Args:
        deltas: ``(N, F, S)`` changes of the state in ``F`` futures.
        mapping: the vocabulary.
        words: of the environment.
        trusted: ``(N, F)`` bool, the futures that the predictor stands by; None: all of them.

    Returns:
        ``N`` phrases, the first ``(N,)`` of the futures that is called so, and the share ``(N,)`` that are and are
        trusted.
    """
    count, futures, size = deltas.shape
    called = phrases_of(mapping.express(deltas.reshape(-1, size)), words).reshape(count, futures)
    alike = called[:, :, None] == called[:, None]
    which = np.argmax(alike.sum(axis=2), axis=1)
    rows = np.arange(count)
    votes = alike[rows, which] if trusted is None else alike[rows, which] & trusted
    return called[rows, which].tolist(), which, votes.sum(axis=1) / futures


def phrases_true_in(mapping: Mapping, episode: Episode, said: Sequence[Explanation], words: Sequence[Phrases]) -> Array:
    """As ``metrics.phrase_hits``, ``(T,)``, of what another vocabulary would have said of the same futures."""
    futures = np.stack([one.futures for one in said])
    phrases, which, _ = voted(futures, mapping, words)
    same = np.array(phrases) == np.array(realised_phrases(episode, said[0].horizon_steps, mapping, words))
    return np.where(mapping.knows(futures[np.arange(len(futures)), which]), same, np.nan)


def _sure(said: Sequence[Explanation], voice: Voice) -> list[Explanation]:
    """How sure the agent is; what it is not sure of, or does not know the meaning of, it does not say."""
    confidence = [one.confidence for one in said]
    if voice.calibration is not None and said:
        confidence = voice.calibration.probability(confidence_features(said)).tolist()
    sure = [each if one.meant else 0.0 for one, each in zip(said, confidence, strict=True)]
    pairs = zip(said, sure, strict=True)
    return [replace(one, confidence=each, known=one.meant and each >= voice.min_confidence) for one, each in pairs]


def confidence_features(said: Sequence[Explanation]) -> Array:
    """``(N, 2)``, see ``CONFIDENCE_FEATURES``."""
    return np.array([(one.agreement, one.purity) for one in said])


def hold(said: Sequence[Explanation], every_steps: int, steps: int) -> list[Explanation]:
    """What is said at each of ``steps`` steps, if something new is said every ``every_steps`` and holds in between."""
    return [said[step // every_steps] for step in range(steps)]
