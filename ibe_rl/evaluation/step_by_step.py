"""Explanations as they are spoken, step by step: do they hold still, are they late, and do they come true?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ibe_rl.collect.rollout import rollouts_with_moments
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.rows import estimate_json
from ibe_rl.evaluation.trained_run import TrainedRun, explainer_state
from ibe_rl.explain.explainer import explain
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES, confidence_features
from ibe_rl.explain.steady import say_steadily
from ibe_rl.instructors import make_instructor, stand_in
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.metrics.confidence import Calibration, ece
from ibe_rl.metrics.quality import realised_phrases
from ibe_rl.metrics.stability import changes_of, lags_steps
from ibe_rl.types import Array, Explanation, Predictor

MOMENTS_AT_ONCE = 200
Aloud = tuple[Sequence[Explanation], Sequence[str]]
"""The explanations of an episode as they are spoken, and the phrases that came true."""


def judge_spoken(
    run: TrainedRun, cfg: ExplainConfig, predictor: Predictor, seeds: Sequence[int], held_out: Sequence[int]
) -> tuple[dict[str, Any], Calibration | None]:
    """Explain whole episodes at every step.

    Args:
        run: the agent.
        cfg: its ``predictor.futures``, and the resamples.
        predictor: of the futures.
        seeds: of the episodes to judge.
        held_out: of those to calibrate the confidence in what is spoken on.

    Returns:
        the part ``spoken`` of quality.json, whose ``rows`` are what is spoken, what each moment alone says, and what
        came true; and the calibration. Nothing without seeds.
    """
    if not seeds or not held_out:
        return {}, None
    spoken = _speak(run, cfg, predictor, seeds)
    calibration = _calibrate(_speak(run, cfg, predictor, held_out))
    numbers = np.repeat(np.arange(len(seeds)), [len(real) for _, real in spoken])
    weights = episode_weights(numbers, cfg.evaluate.resamples, cfg.evaluate.seed)
    said = [[one.phrase for one in each] for each, _ in spoken]
    alone = [[one.of_the_moment or one.phrase for one in each] for each, _ in spoken]
    real = [phrases for _, phrases in spoken]
    rows = [_row(name, each, real, weights) for name, each in (("spoken", said), ("moment", alone), ("real", real))]
    rows[0]["ece"] = estimate_json(_ece(spoken, calibration, weights))
    return {"episodes": len(seeds), "steps": len(numbers), "rows": rows}, calibration


def _speak(run: TrainedRun, cfg: ExplainConfig, predictor: Predictor, seeds: Sequence[int]) -> list[Aloud]:
    explainer = explainer_state(run, cfg.predictor.futures)
    instructor = make_instructor(stand_in(run.config.instructor, run.folder), run.task)
    envs = [run.make_env() for _ in seeds]
    spoken: list[Aloud] = []
    with progress_bar("episodes, step by step", len(seeds)) as advance:
        for episode, moments in rollouts_with_moments(envs, run.policy, instructor, seeds):
            parts = [moments[at : at + MOMENTS_AT_ONCE] for at in range(0, len(moments), MOMENTS_AT_ONCE)]
            said = [one for part in parts for one in explain(part, run.policy, predictor, explainer)]
            real = realised_phrases(episode, run.horizon_steps, run.mapping, run.task.phrases)
            spoken.append((say_steadily(said, explainer), real))
            advance()
    return spoken


def _row(name: str, phrases: Sequence[Sequence[str]], real: Sequence[Sequence[str]], weights: Array) -> dict[str, Any]:
    changed, undone = (np.concatenate(each) for each in zip(*map(changes_of, phrases), strict=True))
    true = np.concatenate([np.asarray(one) == np.asarray(other) for one, other in zip(phrases, real, strict=True)])
    lags = np.concatenate([lags_steps(one, other) for one, other in zip(phrases, real, strict=True)])
    return {
        "explainer": name,
        "came_true": estimate_json(weighted_mean(true, weights)),
        "phrase_changes_per_100": estimate_json(100 * weighted_mean(changed, weights)),
        "flicker": estimate_json(weighted_mean(undone, weights * changed)),
        "lag_steps": None if np.isnan(lags).all() else float(np.nanmedian(lags)),
        "never_said": None if not len(lags) else round(float(np.isnan(lags).mean()), 5),
        "lasting_changes": len(lags),
    }


def _calibrate(spoken: Sequence[Aloud]) -> Calibration:
    features, true, meant = _outcomes(spoken)
    counted = meant if meant.any() else np.ones(len(meant), bool)
    return Calibration.fit(features[counted], true[counted], CONFIDENCE_FEATURES)


def _ece(spoken: Sequence[Aloud], calibration: Calibration, weights: Array) -> Array:
    """Of the confidence in what is spoken, where the meaning of the word is known."""
    features, true, meant = _outcomes(spoken)
    return ece(calibration.probability(features), true, weights * meant)


def _outcomes(spoken: Sequence[Aloud]) -> tuple[Array, Array, Array]:
    """Features ``(T, 2)`` of all explanations, whether each came true, and whether its word has a known meaning."""
    said = [one for each, _ in spoken for one in each]
    real = [phrase for _, phrases in spoken for phrase in phrases]
    true = np.array([one.phrase == phrase for one, phrase in zip(said, real, strict=True)])
    return confidence_features(said), true, np.array([one.meant for one in said])
