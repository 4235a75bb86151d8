"""The paper's prediction task with a simulated observer: do explanations help to predict the end of an episode?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ibe_rl.evaluation.moments import SEEN_STEPS, Moments
from ibe_rl.evaluation.rows import Samples, estimate_json
from ibe_rl.ibe.mapping import mean_degrees
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
    """Let the observer predict the position at the first contact, ``horizon_steps`` ahead.

    Args:
        moments: those with ``observed`` are used, one per episode.
        calibrating: ``(N,)`` true changes over the horizon in other episodes, to calibrate the observer's scale.
        horizon_steps: of the explanations.
        task: with ``motion`` and an instruction of one number, as the observer has one scale.
        vocabularies: explainer to its vocabularies; their errors are averaged.
        resamples: number of bootstrap resamples of episodes.
        seed: of the resamples.

    Returns:
        The ``observer_error`` of each explainer on all resamples, and the report; both are empty without a moment to
        observe. Explainers that give the change itself (``predicted_change``, ``true_future``) need no scale.
    """
    seen = moments[moments.observed]
    if task.motion is None or len(task.explained) != 1 or not len(seen):
        return {}, {"episodes": 0, "rows": []}
    [band], [reach] = task.explained_band, task.explained_range
    observer = calibrate_observer(calibrating, band)
    expected = _expected(seen, observer, horizon_steps, task, vocabularies)
    position, change = _position_and_change(seen, horizon_steps, task)
    errors = {
        name: np.mean([observer_errors(one, position + change, reach) for one in guesses], axis=0)
        for name, guesses in expected.items()
    }
    weights = episode_weights(seen.episode, resamples, seed)
    samples = {name: {"observer_error": weighted_mean(error, weights)} for name, error in errors.items()}
    return samples, _report(samples, observer, len(seen), horizon_steps)


def add_errors(rows: Sequence[dict[str, Any]], samples: Mapping[str, Samples], horizon_steps: int) -> None:
    """Add ``observer_error`` to the rows of one horizon."""
    for row in rows:
        if row["horizon_steps"] == horizon_steps and row["explainer"] in samples:
            row["observer_error"] = estimate_json(samples[row["explainer"]]["observer_error"])


def _position_and_change(seen: Moments, horizon_steps: int, task: Task) -> tuple[Array, Array]:
    [explained] = task.explained
    position = seen.state[:, explained].astype(float)
    return position, seen.realised[:, seen.at(horizon_steps), explained].astype(float)


def _expected(
    seen: Moments,
    observer: Observer,
    horizon_steps: int,
    task: Task,
    vocabularies: Mapping[str, Sequence[ExpressionMapping]],
) -> dict[str, list[Array]]:
    """Explainer to the positions ``(E,)`` that the observer predicts, one array for each of its vocabularies."""
    assert task.motion is not None
    position, change = _position_and_change(seen, horizon_steps, task)
    predicted = seen.predicted[:, :, seen.at(horizon_steps)]
    expected = {
        name: [observer.reads(position, _along(mapping, predicted, task)) for mapping in several]
        for name, several in vocabularies.items()
    }
    return {
        NO_EXPLANATION: [carries_on(position, task.motion(seen.state)[:, 0].astype(float), horizon_steps)],
        **expected,
        "baseline:predicted_change": [position + predicted.mean(axis=1)[:, task.explained[0]]],
        "baseline:true_future": [position + change],
    }


def _along(mapping: ExpressionMapping, predicted: Array, task: Task) -> Array:
    """The expressions ``(E,)`` along the one explained dimension; ``predicted`` ``(E, F, S)``."""
    return expected_motion(mapping, mean_degrees(mapping, predicted), task.explained)[:, 0]


def _report(samples: Mapping[str, Samples], observer: Observer, episodes: int, horizon_steps: int) -> dict[str, Any]:
    errors = {name: each["observer_error"] for name, each in samples.items()}
    return {
        "episodes": episodes,
        "seen_steps": SEEN_STEPS,
        "horizon_steps": horizon_steps,
        "typical": None if math.isnan(observer.typical) else observer.typical,
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
