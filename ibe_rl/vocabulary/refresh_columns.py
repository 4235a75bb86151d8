"""What a refresh adds to a row of metrics.csv."""

from __future__ import annotations

from ibe_rl.metrics.quality import OF_THE_MOMENTS, SCORES
from ibe_rl.vocabulary.refresh import Change, Refresh
from ibe_rl.vocabulary.who_is_late import of_first

REFRESH_COLUMNS = (
    *("ibe/came_true", "ibe/came_true_stale", "ibe/unknown", "ibe/listens", "ibe/delay_steps"),
    *("ibe/phrase_changes_per_100", "ibe/flicker"),
    *("ibe/episodes", "ibe/windows", "ibe/survived", "ibe/vanished", "ibe/emerged"),
    *("ibe/vocabulary_drift", "ibe/expression_moved", "ibe/cluster_agreement", "ibe/policy_drift", "ibe/staleness"),
    *(f"ibe/{name}" for name in SCORES),
    *(f"ibe/{name}_stale" for name in SCORES if name != OF_THE_MOMENTS),
)
"""The columns of metrics.csv of a refresh."""


def figures(refresh: Refresh) -> dict[str, float]:
    """Columns of metrics.csv; ``_stale`` is the previous vocabulary on the same newest episodes."""
    change, scores = refresh.change, refresh.scores
    row: dict[str, float] = {"ibe/episodes": refresh.episodes_used, "ibe/windows": len(refresh.top)}
    if late := of_first(refresh.delays):
        row["ibe/delay_steps"] = late.steps if late.known else float("nan")
    if change is not None:
        scores = refresh.scores if refresh.taken else change.last_scores
        row |= {f"ibe/{name}_stale": value for name, value in change.last_scores.items() if name != OF_THE_MOMENTS}
        row |= {"ibe/policy_drift": change.policy_drift, "ibe/staleness": change.staleness}
        row |= _moved(change) if refresh.taken else {}
    return row | {f"ibe/{name}": value for name, value in scores.items()}


def _moved(change: Change) -> dict[str, float]:
    return {
        "ibe/survived": len(change.transition.survived),
        "ibe/vanished": len(change.transition.vanished),
        "ibe/emerged": len(change.transition.emerged),
        "ibe/vocabulary_drift": change.drift.phrase_changed,
        "ibe/expression_moved": change.drift.expression_moved,
        "ibe/cluster_agreement": change.drift.cluster_agreement,
    }
