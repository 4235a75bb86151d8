"""What the agent says: roll out, take the change of the state, look up its expression, put it in words."""

from __future__ import annotations

from collections.abc import Sequence

from ibe_rl.data import Explanation, Mapping, Moment, Phrases, Policy, Predictor
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
    paths = predictor.rollout(moments, policy, horizon_steps)
    delta = paths[:, -1] - paths[:, 0]
    columns = (mapping.express(delta), mapping.cluster(delta), mapping.confidence(delta))
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
