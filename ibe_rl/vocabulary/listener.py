"""The events of a training, for the table, recording, terminal, page and a user's own listeners and metrics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Explanation
from ibe_rl.vocabulary.refresh import Refresh


@dataclass(frozen=True, eq=False)
class Refreshed:
    """A newly learnt vocabulary, and the explanations of one greedy episode with it.

    Attributes:
        frames: training frames so far.
        number: vocabularies taken so far, this one included.
        refresh: the vocabulary and what it was learnt from.
        rollout: the episode, ``T`` steps.
        said: ``T`` explanations.
        real: ``T`` realised phrases.
        explainer: what the agent explains with from now on.
        came_true: phrase accuracy of ``said``; nan if nothing was said.
    """

    frames: int
    number: int
    refresh: Refresh
    rollout: RecordedRollout
    said: Sequence[Explanation]
    real: Sequence[str]
    explainer: ExplainerState
    came_true: float


class Listener:
    """Is notified of a training's events; a subclass overrides those it needs.

    Attributes:
        essential: True if training cannot continue without it. Any other listener that raises is named and dropped.
        timer: the entry of ``time_s`` that its time is added to.
    """

    essential: bool = False
    timer: str = "stream"

    def begin(self, run: Any) -> None:
        """Training begins or resumes; ``run`` is the ``ibe_rl.training.run.Run``, read-only."""

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """A batch has been learnt from and logged; ``row`` holds the columns of metrics.csv."""

    def refreshed(self, event: Refreshed) -> None:
        """A vocabulary has been learnt."""

    def skipped(self, frames: int, reason: str) -> None:
        """A refresh was due but no vocabulary was learnt."""

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """The greedy policy has been evaluated."""

    def end(self, summary: Mapping[str, Any]) -> None:
        """Training has ended normally; ``summary`` is the content of summary.json."""

    def close(self) -> None:
        """The training is over, however it ended; called last, perhaps without ``end`` and more than once."""

    def news(self) -> Iterable[str]:
        """Messages for the terminal, each returned once."""
        return ()


class Metric:
    """A metric of one's own, at each refresh of a training and in an evaluation; a subclass overrides what it needs.

    One that raises is named and no longer asked; all other results stay.

    Attributes:
        columns: the columns of metrics.csv that it fills.
    """

    columns: Sequence[str] = ()

    def __call__(self, event: Refreshed) -> Mapping[str, float]:
        """A vocabulary has been learnt; returns a value for each of ``columns``."""
        return {}

    def score(self, statements: Any) -> Mapping[str, Any]:
        """Score one explainer in ``task=evaluate`` and ``task=compare``.

        Args:
            statements: an ``ibe_rl.evaluation.own_metrics.Statements``: what it said, and what was true.

        Returns:
            Names to values ``(R,)``, one for each row of ``statements.truth.weights`` ``(R, N)``; the first is the
            point estimate, the others give the interval. Without a name if the metric does not apply.
        """
        return {}
