"""What a listener hears of a training: the table, the recording, the terminal, the teaching page, one's own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ibe_rl.explain.explainer import ExplainerState
from ibe_rl.task import RecordedRollout
from ibe_rl.types import Explanation
from ibe_rl.vocabulary.refresh import Refresh


@dataclass(frozen=True)
class Refreshed:
    """A vocabulary that has just been learnt, and what the agent says with it of one greedy episode.

    Attributes:
        frames: training frames so far.
        number: vocabularies taken so far, this one included.
        refresh: the vocabulary and what it was learnt from.
        rollout: the episode, ``T`` steps.
        said: ``T`` explanations.
        real: ``T`` phrases of what really happened.
        voice: what the agent explains with from now on.
        came_true: share of ``said`` that went as predicted; nan if nothing was said.
    """

    frames: int
    number: int
    refresh: Refresh
    rollout: RecordedRollout
    said: Sequence[Explanation]
    real: Sequence[str]
    voice: ExplainerState
    came_true: float


class Listener:
    """Hears of a training; a subclass overrides what it wants to hear.

    Attributes:
        essential: True if the training cannot go on without it. Any other listener that raises is named and dropped.
        timer: the entry of ``time_s`` that its time counts for.
    """

    essential: bool = False
    timer: str = "stream"

    def begin(self, run: Any) -> None:
        """The training begins, or goes on; ``run`` is the ``ibe_rl.training.run.Run``, to be read only."""

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """A batch has been learnt from and logged; ``row`` holds the columns of metrics.csv."""

    def refreshed(self, event: Refreshed) -> None:
        """A vocabulary has been learnt."""

    def skipped(self, frames: int, reason: str) -> None:
        """A refresh was due, and no vocabulary was learnt."""

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """The greedy policy has been evaluated."""

    def end(self, summary: Mapping[str, Any]) -> None:
        """The training has ended in order; ``summary`` is what summary.json holds."""

    def news(self) -> Iterable[str]:
        """What the person at the terminal should know, each line once."""
        return ()
