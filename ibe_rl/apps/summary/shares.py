"""Shares of phrases by context and phase: what was said, what came, and whether it came as said and as told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ibe_rl.apps.summary.steps import StepTable
from ibe_rl.types import Array

ALL_CONTEXTS, WHOLE_EPISODE = "all", "whole episode"


def phrase_shares(words: Array) -> dict[str, float]:
    """The share of each phrase among ``(N,)``, the most frequent first."""
    found, counts = np.unique(words.astype(str), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return {str(found[i]): round(float(counts[i] / len(words)), 5) for i in order}


def shares_by_context_and_phase(steps: StepTable, contexts: Sequence[str]) -> list[dict[str, Any]]:
    """A row for each context and phase that occurs, those of all contexts first.

    Args:
        steps: of all episodes.
        contexts: of the task, in its order.
    """
    there = [name for name in contexts if (steps.context == name).any()]
    by_context = {ALL_CONTEXTS: steps.everywhere()}
    by_context |= {name: steps.context == name for name in there} if len(there) > 1 else {}
    by_phase = {WHOLE_EPISODE: steps.everywhere()} | steps.phases()
    return [
        {"context": context, "phase": phase, **shares_row(steps, here & then)}
        for context, here in by_context.items()
        for phase, then in by_phase.items()
        if (here & then).any()
    ]


def shares_row(steps: StepTable, part: Array) -> dict[str, Any]:
    """What was said and what came in a part ``(N,)`` bool of the steps."""
    return {
        "episodes": len(np.unique(steps.episode[part])),
        "steps": int(part.sum()),
        "said": phrase_shares(steps.said[part]),
        "came": phrase_shares(steps.came[part]),
        "came_true": steps.share(steps.true, part),
        "not_as_told": steps.share(steps.against, part),
        "said_not_as_told": steps.share(steps.said_against, part),
    }
