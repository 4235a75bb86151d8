"""What the agent says: roll out, take the change of the state, look up its expression, put it in words."""

from __future__ import annotations

from collections.abc import Sequence

from ibe_rl.data import Array, Explanation, Mapping, Moment, Phrases, Policy, Predictor
from ibe_rl.ibe import phrase


def explain(
    moments: Sequence[Moment],
    policy: Policy,
    predictor: Predictor,
    mapping: Mapping,
    horizon_steps: int,
    vocabulary: Sequence[Phrases],
) -> list[Explanation]:
    """Explain the agent's next ``horizon_steps`` steps at each moment (the paper's Algorithm 1 and equation 2).

    Args:
        moments: ``N`` moments, all of them predicted together.
        policy: the greedy policy.
        predictor: where it leads.
        mapping: the vocabulary as last learnt.
        horizon_steps: n, the one the mapping was learnt with.
        vocabulary: the environment's words, one entry for each number of an expression.

    Returns:
        ``N`` explanations.
    """
    if not moments:
        return []
    return put_in_words(predictor.rollout(moments, policy, horizon_steps), mapping, horizon_steps, vocabulary)


def hold(said: Sequence[Explanation], every_steps: int, steps: int) -> list[Explanation]:
    """What is said at each of ``steps`` steps, if something new is said every ``every_steps`` and holds in between."""
    return [said[step // every_steps] for step in range(steps)]


def put_in_words(
    paths: Array, mapping: Mapping, horizon_steps: int, vocabulary: Sequence[Phrases]
) -> list[Explanation]:
    """Say what predictions ``(N, H + 1, S)`` are called in a vocabulary; the rest is as in ``explain``."""
    delta = paths[:, -1] - paths[:, 0]
    columns = (mapping.express(delta), mapping.ids[mapping.cluster(delta)], mapping.confidence(delta))
    return [
        Explanation(
            expression=expression,
            phrase=phrase(expression, vocabulary),
            cluster=int(cluster),
            delta_state=delta[row],
            horizon_steps=horizon_steps,
            confidence=float(confidence),
            path=paths[row],
        )
        for row, (expression, cluster, confidence) in enumerate(zip(*columns, strict=True))
    ]
