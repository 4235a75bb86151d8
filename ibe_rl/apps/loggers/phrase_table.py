"""The vocabulary of a refresh as the rows of a table."""

from __future__ import annotations

from typing import Any

from ibe_rl.task import Task
from ibe_rl.view.sentences import cluster_phrases, expression_text, phrases_before
from ibe_rl.vocabulary.refresh import Refresh

PHRASE_COLUMNS = ("cluster", "expression", "phrase", "before", "windows", "purity", "evidence")


def phrase_rows(refresh: Refresh, task: Task) -> list[list[Any]]:
    """One row of ``PHRASE_COLUMNS`` for each cluster of the current vocabulary; ``before`` is empty if it is new."""
    mapping, before = refresh.standing, phrases_before(refresh, task.phrases)
    return [
        [
            cluster,
            expression_text(mapping.expressions[row], task.phrases),
            phrase,
            before.get(cluster, ""),
            int(mapping.sizes[row]),
            float(mapping.purities[row]),
            float(mapping.evidence[row]),
        ]
        for row, (cluster, phrase) in enumerate(cluster_phrases(mapping, task.phrases).items())
    ]
