"""Whether explanations are true, and what moved since the last refresh."""

from ibe_rl.metrics.bootstrap import (
    Estimate,
    episode_weights,
    estimate,
    motion_scores,
    weighted_auc,
    weighted_mean,
    weighted_spearman,
    went,
)
from ibe_rl.metrics.drift import VocabularyDrift, policy_drift, vocabulary_drift
from ibe_rl.metrics.quality import (
    SCORES,
    came_true,
    happened,
    instruction_f1,
    motion_auc,
    motion_spearman,
    phrases_true,
    vocabulary_scores,
)

__all__ = [
    "SCORES",
    "Estimate",
    "VocabularyDrift",
    "came_true",
    "episode_weights",
    "estimate",
    "happened",
    "instruction_f1",
    "motion_auc",
    "motion_scores",
    "motion_spearman",
    "phrases_true",
    "policy_drift",
    "vocabulary_drift",
    "vocabulary_scores",
    "weighted_auc",
    "weighted_mean",
    "weighted_spearman",
    "went",
]
