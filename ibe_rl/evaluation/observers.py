"""The paper's prediction task with a simulated observer: do explanations help to predict the end of an episode?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ibe_rl.evaluation.moments import SEEN_STEPS, Moments
from ibe_rl.evaluation.rows import Samples, estimate_json
from ibe_rl.ibe.mapping import mean_movements
from ibe_rl.ibe.word_meaning import expected_motion
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.metrics.observer import Observer, calibrate_observer, carries_on, observer_errors
from ibe_rl.task import Task
from ibe_rl.types import Array, ExpressionMapping

NO_EXPLANATION, _PAPER = "no_explanation", "baseline:paper"


def observe_all(
    moments: Moments,
    calibrating: Array,
    horizon_steps: int,
    task: Task,
    vocabularies: Mapping[str, Sequence[ExpressionMapping]],
    resamples: int,
    seed: int,
) -> tuple[dict[str, Samples], dict[str, Any]]:
    """Let the observer predict the position at the first contact or else at the end, ``horizon_steps`` ahead.

    It has one scale for each of the ``d`` numbers; its error is the mean over them.

    Args:
        moments: those with ``observed`` are used, one per episode.
        calibrating: ``(N, d)`` true changes over the horizon in other episodes, to calibrate the observer's scales.
        horizon_steps: of the explanations.
        task: with ``motion``.
        vocabularies: explainer to its vocabularies; their errors are averaged.
        resamples: number of bootstrap resamples of episodes.
        seed: of the resamples.

    Returns:
        The ``observer_error`` of each explainer on all resamples, and the report; both are empty without a moment to
        observe. Explainers that give the change itself (``predicted_change``, ``true_future``) need no scale.
    """
    seen = moments[moments.observed]
    if task.motion is None or not len(seen):
        return {}, {"episodes": 0, "rows": []}
    columns = zip(calibrating.T, task.explained_band, strict=True)
    observers = [calibrate_observer(column, band) for column, band in columns]
    expected = _expected(seen, observers, horizon_steps, task, vocabularies)
    position, change = _position_and_change(seen, horizon_steps, task)
    errors = {
        name: np.mean([_errors(one, position + change, task.explained_range) for one in guesses], axis=0)
        for name, guesses in expected.items()
    }
    weights = episode_weights(seen.episode, resamples, seed)
    samples = {name: {"observer_error": weighted_mean(error, weights)} for name, error in errors.items()}
    return samples, _report(samples, observers, len(seen), horizon_steps)


def add_errors(rows: Sequence[dict[str, Any]], samples: Mapping[str, Samples], horizon_steps: int) -> None:
    """Add ``observer_error`` to the rows of one horizon."""
    for row in rows:
        if row["horizon_steps"] == horizon_steps and row["explainer"] in samples:
            row["observer_error"] = estimate_json(samples[row["explainer"]]["observer_error"])


def _errors(predicted: Array, actual: Array, reach: Sequence[float]) -> Array:
    """Mean over the numbers ``(E,)`` of the errors of predicted positions ``(E, d)``, each in % of its own reach."""
    numbers = zip(predicted.T, actual.T, reach, strict=True)
    mean: Array = np.mean([observer_errors(*number) for number in numbers], axis=0)
    return mean


def _position_and_change(seen: Moments, horizon_steps: int, task: Task) -> tuple[Array, Array]:
    """Positions ``(E, d)`` of the explained dimensions and how they change."""
    explained = list(task.explained)
    position = seen.state[:, explained].astype(float)
    return position, seen.real_change(horizon_steps, explained).astype(float)


def _expected(
    seen: Moments,
    observers: Sequence[Observer],
    horizon_steps: int,
    task: Task,
    vocabularies: Mapping[str, Sequence[ExpressionMapping]],
) -> dict[str, list[Array]]:
    """Explainer to the positions ``(E, d)`` that the observer predicts, one array for each of its vocabularies."""
    assert task.motion is not None
    position, change = _position_and_change(seen, horizon_steps, task)
    predicted = seen.predicted[:, :, seen.at(horizon_steps)]
    expected = {
        name: [_read(observers, position, _along(mapping, predicted, task)) for mapping in several]
        for name, several in vocabularies.items()
    }
    return {
        NO_EXPLANATION: [carries_on(position, task.motion(seen.state).astype(float), horizon_steps)],
        **expected,
        "baseline:predicted_change": [position + predicted.mean(axis=1)[:, list(task.explained)]],
        "baseline:true_future": [position + change],
    }


def _read(observers: Sequence[Observer], position: Array, said: Array) -> Array:
    """Positions ``(E, d)`` that the observers make of positions and expressions ``(E, d)``, one for each number."""
    numbers = zip(observers, position.T, said.T, strict=True)
    return np.stack([one.reads(*number) for one, *number in numbers], axis=1)


def _along(mapping: ExpressionMapping, predicted: Array, task: Task) -> Array:
    """The expressions ``(E, d)`` along the explained dimensions; ``predicted`` ``(E, F, S)``."""
    return expected_motion(mapping, mean_movements(mapping, predicted), task.explained)


def _report(
    samples: Mapping[str, Samples], observers: Sequence[Observer], episodes: int, horizon_steps: int
) -> dict[str, Any]:
    errors = {name: each["observer_error"] for name, each in samples.items()}
    typical = [None if math.isnan(one.typical) else one.typical for one in observers]
    return {
        "episodes": episodes,
        "seen_steps": SEEN_STEPS,
        "horizon_steps": horizon_steps,
        "typical": typical[0] if len(typical) == 1 else typical,
        "rows": [
            {
                "explainer": name,
                "observer_error": estimate_json(error),
                "minus_no_explanation": estimate_json(error - errors[NO_EXPLANATION]),
                "minus_paper": estimate_json(error - errors[_PAPER]) if _PAPER in errors else None,
            }
            for name, error in errors.items()
        ],
    }
