"""The policy changes: is a vocabulary of its own age worth more to it than an earlier one?"""

from __future__ import annotations

from collections.abc import Mapping as Dict
from typing import Any

from ibe_rl.evaluation.moments import Moments
from ibe_rl.evaluation.rows import MOTION, Samples, as_json, difference, over_numbers
from ibe_rl.evaluation.verbalise import speak
from ibe_rl.metrics.bootstrap import episode_weights, estimate, motion_scores, weighted_mean
from ibe_rl.task import Task
from ibe_rl.types import Mapping

METRICS = (*(name for name in MOTION if name != "motion_auc_hard"), "came_true")


def judge_ages(
    policy_frame: int,
    vocabularies: Dict[int, Mapping],
    moments: Moments,
    horizon_steps: int,
    task: Task,
    resamples: int,
    seed: int,
) -> list[dict[str, Any]]:
    """Let the vocabularies of all ages speak for one policy.

    Args:
        policy_frame: training frames when the policy was kept.
        vocabularies: training frames to what was learnt then; those learnt later than the policy are left out.
        moments: of episodes that this policy flew.
        horizon_steps: of the vocabularies.
        task: the environment's own.
        resamples: of the episodes.
        seed: of the resamples.

    Returns:
        A row a vocabulary, oldest first: its metrics, and by how much the one of the policy's own age has more of
        each (``refreshed_minus_this``), paired on the same moments.
    """
    usable = {frame: mapping for frame, mapping in sorted(vocabularies.items()) if frame <= policy_frame}
    weights = episode_weights(moments.episode, resamples, seed)
    change = moments.realised[:, moments.at(horizon_steps)][:, task.explained].astype(float)
    told = moments.instruction.astype(float)
    samples: dict[int, Samples] = {}
    for frame, mapping in usable.items():
        spoken = speak(mapping, moments, horizon_steps, task.phrases)
        numbers = zip(spoken.expression.T, change.T, told.T, task.explained_band, strict=True)
        each = [motion_scores(*number, weights) for number in numbers]
        samples[frame] = {**over_numbers(each), "came_true": weighted_mean(spoken.true, weights)}
    return [
        {
            "policy_frame": policy_frame,
            "vocabulary_frame": frame,
            **{metric: as_json(estimate(each[metric])) for metric in METRICS},
            "refreshed_minus_this": {metric: difference(samples[max(samples)], each, metric) for metric in METRICS},
        }
        for frame, each in samples.items()
    ]
