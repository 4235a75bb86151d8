"""A changing policy: does the vocabulary of its own training stage describe it better than an earlier one?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ibe_rl.evaluation.moments import Moments
from ibe_rl.evaluation.rows import MOTION, Samples, difference, estimate_json, over_numbers
from ibe_rl.evaluation.verbalise import speak
from ibe_rl.ibe.word_meaning import asked_motion, expected_motion
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.metrics.quality import motion_scores
from ibe_rl.task import Task
from ibe_rl.types import ExpressionMapping

AGE_METRICS = (*(name for name in MOTION if name != "motion_auc_hard"), "came_true")


def judge_ages(
    policy_frame: int,
    vocabularies: Mapping[int, ExpressionMapping],
    moments: Moments,
    horizon_steps: int,
    task: Task,
    resamples: int,
    seed: int,
) -> list[dict[str, Any]]:
    """Evaluate one policy with the vocabularies of all stages.

    Args:
        policy_frame: training frames when the policy was saved.
        vocabularies: training frames to the vocabulary learnt then; those newer than the policy are left out.
        moments: of episodes of this policy.
        horizon_steps: of the vocabularies.
        task: the environment's own.
        resamples: number of bootstrap resamples of episodes.
        seed: of the resamples.

    Returns:
        A row for each vocabulary, oldest first: its metrics, and the paired difference of the policy's own vocabulary
        to it (``refreshed_minus_this``) on the same moments.
    """
    usable = {frame: mapping for frame, mapping in sorted(vocabularies.items()) if frame <= policy_frame}
    weights = episode_weights(moments.episode, resamples, seed)
    change = moments.real_change(horizon_steps, task.explained).astype(float)
    samples: dict[int, Samples] = {}
    for frame, mapping in usable.items():
        spoken = speak(mapping, moments, horizon_steps, task.phrases)
        said = expected_motion(mapping, spoken.expression, task.explained)
        instruction = asked_motion(mapping, moments.instruction.astype(float), task.explained, task.explained_band)
        numbers = zip(said.T, change.T, instruction.T, task.explained_band, strict=True)
        each = [motion_scores(one, real, asked, band, weights) for one, real, asked, band in numbers]
        samples[frame] = {**over_numbers(each), "came_true": weighted_mean(spoken.true, weights)}
    return [
        {
            "policy_frame": policy_frame,
            "vocabulary_frame": frame,
            **{metric: estimate_json(each[metric]) for metric in AGE_METRICS},
            "refreshed_minus_this": {metric: difference(samples[max(samples)], each, metric) for metric in AGE_METRICS},
        }
        for frame, each in samples.items()
    ]
