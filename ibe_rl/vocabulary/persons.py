"""The episodes that a person has taught: they count first when the words are learnt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delay import Delay, caught_up
from ibe_rl.ibe.delta import top_episodes
from ibe_rl.instructors.taught import taught_episodes
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Episode

NEWEST_TAUGHT = 300
"""Taught episodes that are read, however many frames ago they were."""
ENOUGH_EPISODES, ENOUGH_WINDOWS = 20, 1_000
"""Episodes in which the person spoke, and windows of the best of these, with which no one else's are needed."""
MOST_WEIGHT = 20
"""How often an episode of the person may count beside those of the others."""


@dataclass(frozen=True)
class PersonsShare:
    """What of the training data of a vocabulary a person said.

    Attributes:
        episodes: of the person, among the best.
        windows: of these, those that begin with an instruction of theirs.
        weight: how often each counts; the others count once.
        only: whether nothing else was used.
        marked: explanations in taught episodes that the person called wrong; those windows are left out.
    """

    episodes: int
    windows: int
    weight: int
    only: bool
    marked: int


@dataclass(frozen=True)
class PersonsEpisodes:
    """Episodes in which a person spoke, with only their own instructions; oldest first.

    Attributes:
        best: by total reward.
        rest: the others.
        marked: see ``PersonsShare``.
    """

    best: Sequence[Episode]
    rest: Sequence[Episode]
    marked: int

    @property
    def windows(self) -> int:
        """Instructions of the person in the best episodes."""
        return int(sum(np.sum(episode.given) for episode in self.best))

    @property
    def suffice(self) -> bool:
        """Whether the words can be learnt from these alone."""
        return len(self.best) + len(self.rest) >= ENOUGH_EPISODES and self.windows >= ENOUGH_WINDOWS

    def caught_up(self, delay: Delay | None) -> PersonsEpisodes:
        """With what the person said at the steps that it was about."""
        return replace(self, best=caught_up(self.best, delay), rest=caught_up(self.rest, delay))

    def share(self, beside: Sequence[Episode]) -> PersonsShare:
        """What they are of the training data, ``beside`` other episodes or alone.

        Beside others they count as often as it takes to weigh as much as these together.
        """
        others = sum(int(np.sum(episode.given)) for episode in beside)
        weight = int(np.clip(others // max(self.windows, 1), 1, MOST_WEIGHT))
        return PersonsShare(len(self.best), self.windows, weight, not beside, self.marked)


def persons_episodes(log: TrajectoryLog, taught: Array, config: MappingConfig) -> PersonsEpisodes | None:
    """Read what a person has said; None if that is nothing.

    Args:
        log: of the run.
        taught: rows of its index, of the episodes that the person could teach.
        config: which of them are the best.
    """
    rows = taught[-NEWEST_TAUGHT:]
    episodes, marked = taught_episodes(log, rows.tolist(), config.horizon_steps or 0)
    spoken = np.array([bool(np.any(episode.given)) for episode in episodes], bool)
    if not spoken.any():
        return None
    rows, episodes = rows[spoken], [one for one, any_word in zip(episodes, spoken, strict=True) if any_word]
    groups = log.context_names[rows] if config.top_within == "context" else None
    is_best = top_episodes(log.index["total_reward"][rows], config.top_fraction, groups).tolist()
    best = [one for one, good in zip(episodes, is_best, strict=True) if good]
    return PersonsEpisodes(best, [one for one, good in zip(episodes, is_best, strict=True) if not good], marked)
