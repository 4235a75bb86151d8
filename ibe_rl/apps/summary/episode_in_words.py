"""One episode in words, as all other modules of the summary read it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.task import RecordedRollout
from ibe_rl.types import Array, Episode

DRAWN_EVERY_STEPS = 3
"""Of a film; what is between them is not kept."""


@dataclass(frozen=True)
class PlayedEpisode:
    """An episode of ``T`` steps in words.

    Attributes:
        seed: of the episode.
        watched: the episode, without its moments, and drawn at each ``DRAWN_EVERY_STEPS`` only.
        told: ``T`` instructions in words.
        said: ``T`` phrases as they were spoken, with "I do not know" and "I cannot tell".
        came: ``T`` phrases of what then happened.
        expressions: ``(T, d)`` of what was said.
        came_expressions: ``(T, d)`` of what then happened.
        known: ``(T,)`` bool, whether a phrase was spoken.
        against: ``(T,)`` whether it went another way than told, NaN where nothing was told or nobody can say.
        said_against: ``(T,)`` the same of the way that was said.
        contact: the step at which the outcome is visible, ``Task.first_contact``; None if the task declares none.
        paths: ``(K, H + 1, S)`` the predicted states at these ``K`` steps.
    """

    seed: int
    watched: RecordedRollout
    told: Sequence[str]
    said: Sequence[str]
    came: Sequence[str]
    expressions: Array
    came_expressions: Array
    known: Array
    against: Array
    said_against: Array
    contact: int | None
    paths: Array

    def __len__(self) -> int:
        return len(self.said)

    @property
    def episode(self) -> Episode:
        """The episode itself."""
        return self.watched.episode

    @property
    def true(self) -> Array:
        """``(T,)`` whether it came as said; NaN where nothing was said."""
        same = np.array([one == other for one, other in zip(self.said, self.came, strict=True)], float)
        return np.where(self.known, same, np.nan)
