"""Whether explanations are true, and what moved since the last refresh."""

from ibe_rl.metrics.balance import left_right, size_cv, size_max
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
from ibe_rl.metrics.confidence import Calibration, brier, ece, risk_at, risk_coverage
from ibe_rl.metrics.drift import VocabularyDrift, policy_drift, vocabulary_drift
from ibe_rl.metrics.observer import Observer, calibrate_observer, carries_on, observer_errors
from ibe_rl.metrics.quality import (
    SCORES,
    happened,
    instruction_f1,
    motion_auc,
    motion_spearman,
    phrases_true,
    vocabulary_scores,
)

__all__ = [
    "SCORES",
    "Calibration",
    "Estimate",
    "Observer",
    "VocabularyDrift",
    "brier",
    "calibrate_observer",
    "carries_on",
    "ece",
    "episode_weights",
    "estimate",
    "happened",
    "instruction_f1",
    "left_right",
    "motion_auc",
    "motion_scores",
    "motion_spearman",
    "observer_errors",
    "phrases_true",
    "policy_drift",
    "risk_at",
    "risk_coverage",
    "size_cv",
    "size_max",
    "vocabulary_drift",
    "vocabulary_scores",
    "weighted_auc",
    "weighted_mean",
    "weighted_spearman",
    "went",
]
