"""Evaluate all explainers at one horizon, on the same moments and resamples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import numpy as np

from ibe_rl.evaluation.baselines import CHEAP, Learnt, as_instruction, cheap_baselines, forecasts
from ibe_rl.evaluation.controls import Flipped, of_another_moment
from ibe_rl.evaluation.moments import Moments, Spoken
from ibe_rl.evaluation.rows import (
    Judged,
    OwnScores,
    Samples,
    Statements,
    Truth,
    add_loss,
    balance,
    difference,
    estimate_json,
    fixed,
    laid_out,
    own_columns,
    score,
    score_confidence,
    score_words_alone,
    spread_over,
)
from ibe_rl.evaluation.verbalise import calibrate, speak
from ibe_rl.ibe.word_meaning import expected_motion
from ibe_rl.metrics.quality import word_f1
from ibe_rl.task import Task
from ibe_rl.types import Array, ExpressionMapping

GOALS = ("motion_auc", "motion_auc_disobeyed", "motion_spearman")
"""Metrics compared with the cheap baselines and the paper, paired by moments."""
_PREDICTED, _TRUE_FUTURE = "baseline:predicted_change", "baseline:true_future"


def judge(
    learnt: Learnt,
    moments: Moments,
    held_out: Moments,
    horizon_steps: int,
    task: Task,
    weights: Array,
    seed: int,
    step: Callable[[], None] = lambda: None,
    own: OwnScores = lambda _: {},
) -> Judged:
    """Evaluate every explainer at one horizon.

    Args:
        learnt: the vocabularies, the evaluated one first.
        moments: to evaluate on.
        held_out: moments of other episodes, only to calibrate the confidence.
        horizon_steps: one of the horizons of ``moments``.
        task: the environment's own.
        weights: ``(R, N)`` of the resamples.
        seed: of the control with predictions of another moment.
        step: called after each explainer.
        own: the scores of metrics of one's own.
    """
    ours = next(iter(learnt.vocabularies.values()))
    truth = Truth.of(moments, horizon_steps, task, forecasts(learnt.regressors, moments.state), weights, ours)
    judged = Judged(truth, task.number_names, mappings=dict(learnt.vocabularies))
    for name, said in _simple(learnt, moments, horizon_steps, task, truth.instruction).items():
        on_scale = as_instruction(name, said, task.explained_band)
        judged.samples[f"baseline:{name}"] = score(Statements(f"baseline:{name}", said, on_scale, truth), own)
        step()
    _judge_vocabularies(judged, moments, held_out, horizon_steps, task, step, own)
    if learnt.ensembles:
        _judge_controls(judged, learnt, moments, horizon_steps, task, seed, step, own)
    refits = [each for several in judged.refits.values() for each in several]
    for samples in (*judged.samples.values(), *refits):
        if "came_true" in samples:
            add_loss(samples, judged.samples[_PREDICTED])
    return judged


def _simple(learnt: Learnt, moments: Moments, horizon_steps: int, task: Task, instruction: Array) -> dict[str, Array]:
    """Statements ``(N, d)`` of all explainers without a vocabulary."""
    at, explained = moments.at(horizon_steps), task.explained
    return cheap_baselines(moments, horizon_steps, task, learnt.regressors, instruction) | {
        "predicted_change": moments.predicted[:, :, at].mean(axis=1)[:, explained].astype(float),
        "true_future": moments.real_change(horizon_steps, explained).astype(float),
    }


def _judge_vocabularies(
    judged: Judged,
    moments: Moments,
    held_out: Moments,
    horizon_steps: int,
    task: Task,
    step: Callable[[], None],
    own: OwnScores,
) -> None:
    for name, mapping in judged.mappings.items():
        spoken = speak(mapping, moments, horizon_steps, task.phrases)
        calibration = calibrate(speak(mapping, held_out, horizon_steps, task.phrases))
        probability = calibration.probability(spoken.features)
        judged.samples[name] = _score(name, spoken, mapping, task, judged.truth, own) | score_confidence(
            probability, spoken.voted_true, judged.truth, spoken.known
        )
        judged.spoken[name], judged.calibrations[name] = spoken, calibration
        judged.probabilities[name] = probability
        step()


def _judge_controls(
    judged: Judged,
    learnt: Learnt,
    moments: Moments,
    horizon_steps: int,
    task: Task,
    seed: int,
    step: Callable[[], None],
    own: OwnScores,
) -> None:
    """Negative controls: the vocabulary flipped, another moment's future, vocabularies of shuffled instructions."""
    ours = next(iter(learnt.vocabularies.values()))
    elsewhere = of_another_moment(moments, np.random.default_rng(seed))
    for name, mapping, where in (("flipped", Flipped(ours), moments), ("another_moment", ours, elsewhere)):
        spoken, name = speak(mapping, where, horizon_steps, task.phrases), f"baseline:{name}"
        judged.samples[name] = _score(name, spoken, mapping, task, judged.truth, own)
        step()
    alone, first = judged.truth.unweighed(), moments.first_future()
    for name, several in learnt.ensembles.items():
        judged.refits[name] = []
        for mapping in several:
            scores = _score(name, speak(mapping, first, horizon_steps, task.phrases), mapping, task, alone, own)
            judged.refits[name].append({metric: scores[metric] for metric in scores if metric != "came_true_voted"})
            step()


def _score(name: str, spoken: Spoken, mapping: ExpressionMapping, task: Task, truth: Truth, own: OwnScores) -> Samples:
    said = expected_motion(mapping, spoken.expression, task.explained)
    scores = score(Statements(name, said, said, truth, spoken), own)
    scores |= score_words_alone(expected_motion(mapping, spoken.said, task.explained), truth)
    if task.words is None:
        return scores
    return scores | {"word_f1": word_f1(spoken.word, spoken.real_word, spoken.told_word, truth.weights)}


def rows_of(judged: Judged) -> list[dict[str, Any]]:
    """The rows of the report for one horizon, evaluated explainers first; null where a metric is undefined."""
    horizon = judged.truth.horizon_steps
    refits = {name: _complete(several) for name, several in judged.refits.items()}
    own = own_columns([*chain(*judged.samples.values(), *refits.values())])
    rows = []
    for name, samples in judged.samples.items():
        metrics = {metric: estimate_json(values) for metric, values in samples.items()}
        metrics |= balance(judged.mappings[name]) if name in judged.mappings else {}
        rows.append({"explainer": name, "horizon_steps": horizon} | laid_out(metrics, judged.names, own))
    for name, scores in refits.items():
        metrics = {metric: spread_over(map(float, values)) for metric, values in scores.items()}
        row = {"explainer": name, "horizon_steps": horizon} | laid_out(metrics, judged.names, own)
        each = {metric: [_rounded(value) for value in values] for metric, values in scores.items()}
        rows.append(row | {"over": "refits", "refits": each})
    return sorted(rows, key=lambda row: not row["explainer"].startswith("ibe:"))


def _complete(several: Sequence[Samples]) -> dict[str, list[float]]:
    """Metric to its value of each refit, where all have it: a metric of one's own may fail in between."""
    return {
        metric: [each[metric][0] for each in several]
        for metric in several[0]
        if all(metric in each for each in several)
    }


def _rounded(value: float) -> float | None:
    return None if np.isnan(value) else round(float(value), 5)


def paired_of(judged: Judged, ours: str) -> list[dict[str, Any]]:
    """Paired differences of the evaluated vocabulary to the cheap baselines and the paper's, on the same moments."""
    cheap = [f"baseline:{name}" for name in CHEAP if f"baseline:{name}" in judged.samples]
    found = []
    for metric in GOALS:
        best = max(cheap, key=lambda name: _at_least(judged.samples[name][metric][0]))
        for other in [*cheap, "baseline:paper"]:
            less = difference(judged.samples[ours], judged.samples[other], metric)
            found.append(
                {
                    "metric": metric,
                    "horizon_steps": judged.truth.horizon_steps,
                    "explainer": ours,
                    "minus": other,
                    "best_cheap": other == best,
                    "difference": less,
                }
            )
    return found


def _at_least(value: float) -> float:
    return -np.inf if np.isnan(value) else float(value)


def confidence_of(judged: Judged, ours: str) -> dict[str, Any]:
    """Gain of explaining only when confident, and of the confidence over the constant base rate."""
    samples, true, known = judged.samples[ours], judged.spoken[ours].voted_true, judged.spoken[ours].known
    share = float(np.mean(true[known])) if known.any() else 0.0
    base = score_confidence(np.full(len(true), share), true, judged.truth, known)
    return {
        "explainer": ours,
        "horizon_steps": judged.truth.horizon_steps,
        "risk_at_80_minus_risk_all": estimate_json(samples["risk_at_80"] - samples["risk_all"]),
        "brier_minus_base_rate": difference(samples, base, "brier"),
        "base_rate": fixed(share),
    }
