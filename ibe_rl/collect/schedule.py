"""Schedules of recurring events, in frames."""

from __future__ import annotations

import math

from ibe_rl.config.settings import TrainConfig

REFRESHES_OF_A_RUN, REFRESH_AT_MOST_EVERY = 8, 250_000
DENSE = 200
"""After ``2 * DENSE`` firings the interval of a ``GeometricSchedule`` doubles whenever the frame count does."""


class Schedule:
    """True once in every ``frames`` frames, at the first batch that reaches them, and at the end.

    Args:
        frames: the interval; None means never, not even at the end.
        now: frames at the start.
    """

    def __init__(self, frames: int | None, now: int = 0):
        self._frames, self._passed = frames, now // (frames or 1)

    def __call__(self, frames: int, last: bool = False) -> bool:
        """Whether a multiple has been reached since the last call, or this is the ``last`` one."""
        if self._frames is None:
            return False
        before, self._passed = self._passed, frames // self._frames
        return last or self._passed > before


def refresh_interval(config: TrainConfig) -> int | None:
    """Frames between refreshes; None without refreshes."""
    if config.refresh_every_frames != 0:
        return config.refresh_every_frames
    return max(1, min(REFRESH_AT_MOST_EVERY, config.total_frames // REFRESHES_OF_A_RUN))


class RefreshSchedule:
    """True at each multiple of ``refresh_interval`` and at the end, and before that once enough episodes have ended.

    Args:
        config: with the interval, and the episodes.
        frames: at the start.
        begun: whether a refresh has been tried before: then the early one has been.
    """

    def __init__(self, config: TrainConfig, frames: int = 0, begun: bool = False):
        self._interval = refresh_interval(config)
        self._regular = Schedule(self._interval, frames)
        self._first_episodes = 0 if begun else config.first_refresh_episodes

    def __call__(self, frames: int, episodes: int, last: bool = False) -> bool:
        """Whether a refresh is due with so many frames and episodes behind, or at the ``last`` batch."""
        early = self._interval is not None and 0 < self._first_episodes <= episodes
        due = self._regular(frames, last) or early
        if due:
            self._first_episodes = 0
        return due


class GeometricSchedule:
    """For files that are kept: true once in every ``frames`` frames, later in every 2, 4, 8 times as many.

    Args:
        frames: the interval at the beginning; None means never.
        now: frames at the start.
    """

    def __init__(self, frames: int | None, now: int = 0):
        self._frames, self._last = frames, now

    def __call__(self, frames: int) -> bool:
        """Whether a multiple has been reached since the last call."""
        if self._frames is None:
            return False
        every = self._frames * 2 ** max(0, int(math.log2(frames / (DENSE * self._frames))))
        before, self._last = self._last, frames
        return frames // every > before // every
