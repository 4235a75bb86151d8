"""A changing policy: does the vocabulary of its own training stage describe it better than an earlier one?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ibe_rl.evaluation.moments import Moments, Plan
from ibe_rl.evaluation.rollouts import Rollouts
from ibe_rl.evaluation.rows import MOTION, Samples, difference, estimate_json, over_numbers
from ibe_rl.evaluation.verbalise import speak
from ibe_rl.metrics.bootstrap import episode_weights, weighted_mean
from ibe_rl.metrics.quality import motion_scores
from ibe_rl.task import Task
from ibe_rl.types import ExpressionMapping, Policy

AGE_METRICS = (*(name for name in MOTION if name != "motion_auc_hard"), "came_true")


def judge_all_ages(
    rollouts: Rollouts, policies: Mapping[int, Policy], vocabularies: Mapping[int, ExpressionMapping]
) -> list[dict[str, Any]]:
    """Evaluate each saved policy with the vocabularies of its own stage and all earlier ones.

    Args:
        rollouts: of the run.
        policies: training frames to the policy saved then, oldest first.
        vocabularies: training frames to the vocabulary learnt then.
    """
    run, config, rows = rollouts.run, rollouts.cfg.evaluate, []
    plan = Plan(config.stride_steps, 1, (run.horizon_steps,))
    for frame, policy in policies.items():
        if not any(learnt <= frame for learnt in vocabularies):
            continue
        title = f"futures of the policy of frame {frame:,}"
        moments = rollouts.gather("changing", config.changing_episodes, plan, title, policy).judged()
        rows += judge_ages(frame, vocabularies, moments, run.horizon_steps, run.task, config.resamples, config.seed)
    return rows


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
    instruction = moments.instruction.astype(float)
    samples: dict[int, Samples] = {}
    for frame, mapping in usable.items():
        spoken = speak(mapping, moments, horizon_steps, task.phrases)
        numbers = zip(spoken.expression.T, change.T, instruction.T, task.explained_band, strict=True)
        each = [motion_scores(said, real, asked, band, weights) for said, real, asked, band in numbers]
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
