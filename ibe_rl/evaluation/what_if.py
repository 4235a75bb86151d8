"""Is it true what the agent says it would do if it were told something else?

In copies of held-out moments each value is really given for the next steps.

Shapes: ``N`` moments, ``W`` values, ``F`` futures, ``S`` state dimensions, ``R`` resamples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ibe_rl.config.settings import ExplainConfig
from ibe_rl.envs.make import make_snapshot_env
from ibe_rl.envs.snapshots import stoppable
from ibe_rl.evaluation.moments import FUTURES_AT_ONCE, TakenMoment
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.rows import WHAT_IF, estimate_json
from ibe_rl.evaluation.trained_run import WHAT_IF_CALIBRATION, TrainedRun
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, majority_phrases
from ibe_rl.explain.what_if import Values, listening, told_twins, values_of
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.metrics.confidence import Calibration, ece
from ibe_rl.predict.simulator import Simulator
from ibe_rl.task import Phrases
from ibe_rl.types import Array, ExpressionMapping, Moment, Policy, Predictor

CANNOT_COPY = "what-if is not judged: this environment cannot be copied, so no word can be given in a copy of a moment"
TRUTH_SEED = 7_919
"""Added to the seed of the evaluation: the chance events of the truth are others than those of the predictions."""


@dataclass(frozen=True)
class AskedMoments:
    """``N`` moments, what was foretold of them for ``W`` values, and what then happened.

    Attributes:
        episode: ``(N,)`` number of the episode.
        values: that were said, by name.
        plain: ``(N, F, S)`` predicted changes without being told anything else.
        predicted: ``(N, W, F, S)`` predicted changes if told each value.
        trusted: ``(N, W, F)`` bool, whether the predictor trusts them.
        realised: ``(N, W, S)`` changes where each value was really given.
    """

    episode: Array
    values: Values
    plain: Array
    predicted: Array
    trusted: Array
    realised: Array


@dataclass(frozen=True)
class JudgedAnswers:
    """The answers of one vocabulary at ``N`` moments to ``W`` values.

    Attributes:
        phrase: ``(N, W)``.
        real: ``(N, W)`` phrases of what happened.
        plain: ``(N,)`` phrases of the explanations without being told anything else.
        known: ``(N, W)`` bool, whether the meaning of the phrase is known.
        features: ``(N, W, 2)``, see ``CONFIDENCE_FEATURES``.
        listens: ``(N,)``, see ``listening``.
    """

    phrase: Array
    real: Array
    plain: Array
    known: Array
    features: Array
    listens: Array

    @property
    def true(self) -> Array:
        """Whether the answers came true, ``(N, W)``."""
        return self.phrase == self.real

    def calibrate(self) -> Calibration:
        """From the features to the probability that an answer comes true."""
        counted = self.known if self.known.any() else np.ones_like(self.known)
        return Calibration.fit(self.features[counted], self.true[counted], CONFIDENCE_FEATURES)


def ask_and_give(
    moments: Sequence[TakenMoment],
    policy: Policy,
    predictor: Predictor,
    world: Predictor,
    values: Values,
    futures: int,
    horizon_steps: int,
) -> AskedMoments:
    """Ask at each moment for each value, and then give it in a copy.

    Args:
        moments: of greedy episodes.
        policy: the greedy policy.
        predictor: foretells.
        world: rolls out copies, with chance events of its own.
        values: to be said.
        futures: ``F``, of each answer.
        horizon_steps: for which a value is said.
    """
    at_once = max(1, FUTURES_AT_ONCE // (futures * (1 + len(values))))
    parts = []
    with progress_bar("what if it were told something else", -(-len(moments) // at_once)) as advance:
        for start in range(0, len(moments), at_once):
            here = [one.moment for one in moments[start : start + at_once]]
            changes, trusted = _foretold(here, policy, predictor, values, futures, horizon_steps)
            parts.append(
                (changes[:, 0], changes[:, 1:], trusted[:, 1:], _given(here, policy, world, values, horizon_steps))
            )
            advance()
    plain, predicted, trusted, realised = (np.concatenate(each) for each in zip(*parts, strict=True))
    return AskedMoments(np.array([one.episode for one in moments]), values, plain, predicted, trusted, realised)


def _foretold(
    moments: Sequence[Moment], policy: Policy, predictor: Predictor, values: Values, futures: int, horizon_steps: int
) -> tuple[Array, Array]:
    """Changes ``(N, 1 + W, F, S)``, first of the moments as they are, and whether they are trusted."""
    several = [moment for moment in moments for _ in range(futures)]
    predicted = predictor.rollout([*several, *told_twins(several, values)], policy, horizon_steps)
    shape = (1 + len(values), len(moments), futures)
    changes = (predicted.paths[:, -1] - predicted.paths[:, 0]).reshape(*shape, -1)
    trusted = (predicted.trusted_steps >= horizon_steps).reshape(shape)
    return changes.swapaxes(0, 1), trusted.swapaxes(0, 1)


def _given(moments: Sequence[Moment], policy: Policy, world: Predictor, values: Values, horizon_steps: int) -> Array:
    """Changes ``(N, W, S)`` where each value is given in a copy."""
    copies = [replace(moment, instruction=value, given=True) for moment in moments for value in values.values()]
    paths = world.rollout(copies, policy, horizon_steps).paths
    return np.asarray((paths[:, -1] - paths[:, 0]).reshape(len(moments), len(values), -1))


def answer(asked: AskedMoments, mapping: ExpressionMapping, words: Sequence[Phrases]) -> JudgedAnswers:
    """Put predictions and what happened into the words of a vocabulary."""
    shape, size = asked.realised.shape[:2], asked.realised.shape[-1]
    deltas = asked.predicted.reshape(-1, *asked.predicted.shape[2:])
    phrases, which, agreement = majority_phrases(deltas, mapping, words, asked.trusted.reshape(len(deltas), -1))
    spoken = deltas[np.arange(len(deltas)), which]
    expressions = mapping.express(spoken).reshape(*shape, -1)
    return JudgedAnswers(
        phrase=np.array(phrases).reshape(shape),
        real=phrases_of(mapping.express(asked.realised.reshape(-1, size)), words).reshape(shape),
        plain=np.array(majority_phrases(asked.plain, mapping, words)[0]),
        known=mapping.knows(spoken).reshape(shape),
        features=np.stack([agreement, mapping.confidence(spoken)], axis=-1).reshape(*shape, -1),
        listens=listening(expressions, np.array([*asked.values.values()])),
    )


def row_of(name: str, answers: JudgedAnswers, calibration: Calibration, weights: Array) -> dict[str, Any]:
    """The row of a vocabulary, where the meaning of the words is known.

    Args:
        name: of the explainer.
        answers: at ``N`` moments.
        calibration: of the confidence, from other episodes.
        weights: ``(R, N)`` of the resamples of the episodes.
    """
    probability = calibration.probability(answers.features.reshape(-1, answers.features.shape[-1]))
    each = np.repeat(weights, answers.true.shape[1], axis=1) * answers.known.ravel()
    other = each * (answers.phrase != answers.plain[:, None]).ravel()
    return _row(name, answers.true, each, other) | {
        "what_if_ece": estimate_json(ece(probability, answers.true.ravel(), each)),
        "listens": estimate_json(weighted_mean(answers.listens, weights)),
        "whatever": estimate_json(weighted_mean((answers.phrase == answers.phrase[:, :1]).all(axis=1), weights)),
        "each": [
            {"value": value, "what_if_came_true": estimate_json(weighted_mean(true, weights * known))}
            for value, true, known in zip(range(answers.true.shape[1]), answers.true.T, answers.known.T, strict=True)
        ],
    }


def _row(name: str, true: Array, each: Array, other: Array) -> dict[str, Any]:
    """Share that came true among all answers, and among those that differ from the plain explanation."""
    return {
        "explainer": name,
        "what_if_came_true": estimate_json(weighted_mean(true.ravel(), each)),
        "what_if_came_true_other": estimate_json(weighted_mean(true.ravel(), other)),
    }


def baseline_rows(
    answers: JudgedAnswers, values: Values, words: Sequence[Phrases], weights: Array
) -> list[dict[str, Any]]:
    """Two that ask nobody: it does what it does anyway, and it does what it is told."""
    obeyed = phrases_of(np.array([*values.values()]), words)
    guesses = {"as_it_is": answers.plain[:, None], "obeys": obeyed[None]}
    each = np.repeat(weights, answers.true.shape[1], axis=1) * answers.known.ravel()
    other = each * (answers.phrase != answers.plain[:, None]).ravel()
    return [_row(f"baseline:{name}", guess == answers.real, each, other) for name, guess in guesses.items()]


@dataclass(frozen=True)
class WhatIf:
    """The what-if part of an evaluation.

    Attributes:
        report: contents of quality.json under ``what_if``; None if it was not judged.
        calibration: of the confidence of the evaluated explainer's answers.
        note: why it was not judged; empty if nobody asked.
    """

    report: dict[str, Any] | None = None
    calibration: Calibration | None = None
    note: str = ""

    def add_to(self, rows: Sequence[dict[str, Any]], horizon_steps: int) -> None:
        """Fill the metrics of the explainers in the rows of the report."""
        found = {row["explainer"]: row for row in (self.report or {}).get("rows", ())}
        for row in rows:
            if row["horizon_steps"] == horizon_steps and row["explainer"] in found:
                row |= {name: found[row["explainer"]].get(name) for name in WHAT_IF}

    @property
    def calibration_json(self) -> dict[str, Any]:
        """Contents of calibration.json; empty if it was not judged."""
        return {} if self.calibration is None else {WHAT_IF_CALIBRATION: self.calibration.to_dict()}


def judge_what_if(
    run: TrainedRun,
    cfg: ExplainConfig,
    predictor: Predictor,
    vocabularies: Mapping[str, ExpressionMapping],
    take: Callable[[str, int], Sequence[TakenMoment]],
    processes: int = 1,
) -> WhatIf:
    """Ask and give each value at moments of held-out episodes.

    Args:
        run: provides policy, environment and words.
        cfg: of the evaluation.
        predictor: that foretells.
        vocabularies: by the name of their explainer, the evaluated one first; all of the run's horizon.
        take: plays so many held-out episodes for a purpose; their moments.
        processes: in which the copies are.
    """
    if stoppable(run.make_env()) is None:
        return WhatIf(note=CANNOT_COPY)
    config, values, words = cfg.evaluate, values_of(run.task), run.task.phrases
    judged, held_out = (
        _asked(run, cfg, predictor, values, take(purpose, episodes), processes)
        for purpose, episodes in (("judged", config.episodes), ("held_out", config.calibration_episodes))
    )
    weights = episode_weights(judged.episode, config.resamples, config.seed)
    rows, calibrations = [], {}
    for name, mapping in vocabularies.items():
        calibrations[name] = answer(held_out, mapping, words).calibrate()
        rows.append(row_of(name, answer(judged, mapping, words), calibrations[name], weights))
    ours = next(iter(vocabularies))
    rows += baseline_rows(answer(judged, vocabularies[ours], words), values, words, weights)
    report = {
        "values": {name: value.tolist() for name, value in values.items()},
        "horizon_steps": run.horizon_steps,
        "stride": config.what_if_stride_steps,
        "episodes": config.episodes,
        "moments": len(judged.episode),
        "rows": [row | {"horizon_steps": run.horizon_steps} for row in rows],
    }
    return WhatIf(report, calibrations[ours])


def _asked(
    run: TrainedRun,
    cfg: ExplainConfig,
    predictor: Predictor,
    values: Values,
    moments: Sequence[TakenMoment],
    processes: int,
) -> AskedMoments:
    make_env, seed = partial(make_snapshot_env, run.config.env), cfg.evaluate.seed + TRUTH_SEED
    world = Simulator(make_env, run.task.rule, processes=processes, seed=seed)
    try:
        return ask_and_give(moments, run.policy, predictor, world, values, cfg.predictor.futures, run.horizon_steps)
    finally:
        world.close()
