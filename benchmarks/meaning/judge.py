"""Does the vocabulary say what is true?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.meaning.trial import Trial, Truth
from ibe_rl.ibe import delta_states
from ibe_rl.metrics.quality import motion_auc
from ibe_rl.types import Array, ExpressionMapping

STRIDE_STEPS = 4
SPOKEN = 0.2
"""Share of windows with a known word, below which the agent counts as silent."""
TRUE, REVERSED = 0.9, 0.4
"""Motion AUC: at least the first is true, below the second is reversed."""


@dataclass(frozen=True)
class Verdict:
    """How true a vocabulary is.

    Attributes:
        outcome: "true", "weak", "reversed", or "silent" if the words are known in less than ``SPOKEN`` of the windows.
        auc: motion AUC along the true direction, whether the words are known or not; nan without any vocabulary.
        known: share of the windows in which they are.
        reason: why there is none, or what the vocabulary says it stands on.
    """

    outcome: str
    auc: float
    known: float
    reason: str = ""


def fresh_changes(trial: Trial) -> Array:
    """Changes ``(W, S)`` of the state over the horizon, from every fourth step of the new episodes."""
    return np.concatenate(
        [delta_states(episode.states, trial.horizon_steps, "clamp")[::STRIDE_STEPS] for episode in trial.fresh]
    )


def judge(mapping: ExpressionMapping, trial: Trial, truth: Truth) -> Verdict:
    """Compare a vocabulary with the truth.

    Raises:
        ValueError: if the test episodes do not move both ways, which makes the AUC undefined.
    """
    delta = fresh_changes(trial)
    said, known = mapping.express(delta)[:, 0], float(np.mean(mapping.knows(delta)))
    auc = motion_auc(said, delta @ truth.direction, truth.band)
    if np.isnan(auc):
        raise ValueError(f"{trial.name}: its new episodes do not go both ways by {truth.band}")
    reason = "; ".join(one.reason for one in getattr(mapping, "meanings", ()) if one.reason)
    return Verdict(_outcome(auc, known), auc, known, reason)


def _outcome(auc: float, known: float) -> str:
    if known < SPOKEN:
        return "silent"
    if auc >= TRUE:
        return "true"
    return "reversed" if auc < REVERSED else "weak"
