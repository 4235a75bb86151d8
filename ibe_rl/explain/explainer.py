"""What the agent says: roll out the policy, look up the expression of the change of the state, put it into words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ibe_rl.explain.phrasing import AHEAD_STEPS, ExplainerState, hold, put_in_words
from ibe_rl.explain.steady import say_steadily
from ibe_rl.explain.what_if import told_twins, with_answers
from ibe_rl.types import Array, Explanation, Moment, Policy, Prediction, Predictor


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
    longest, asking = max([explainer.horizon_steps, *explainer.spans]) + max(AHEAD_STEPS), explainer.what_if
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


def narrate(
    moments: Sequence[Moment], policy: Policy, predictor: Predictor, explainer: ExplainerState, every_steps: int = 1
) -> list[Explanation]:
    """Explain an episode as it is spoken: one of so many moments, and each explanation holds until the next.

    Returns:
        as many explanations as moments.
    """
    said = explain(moments[::every_steps], policy, predictor, explainer)
    return hold(say_steadily(said, explainer, every_steps), every_steps, len(moments))
