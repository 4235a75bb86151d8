"""Whether explanations are true, and what moved since the last refresh."""

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
    "VocabularyDrift",
    "came_true",
    "happened",
    "instruction_f1",
    "motion_auc",
    "motion_spearman",
    "phrases_true",
    "policy_drift",
    "vocabulary_drift",
    "vocabulary_scores",
]
