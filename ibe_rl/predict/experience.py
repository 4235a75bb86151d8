"""Training data of a predictor: the newest episodes of the log, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.task import choices_of
from ibe_rl.types import Array, ConfigError, Episode


def newest_episodes(log: TrajectoryLog, frames: int, until_frame: int | None = None) -> list[Episode]:
    """The newest whole episodes of the log, of about this many frames.

    Args:
        log: of a run.
        frames: approximate number of steps in total; at least one episode.
        until_frame: those that ended by this frame of the training; None: all.

    Raises:
        ValueError: if there is none.
    """
    index = log.index
    rows = np.flatnonzero(index["frame"] <= (log.frames if until_frame is None else until_frame))
    if not len(rows):
        raise ValueError(f"{log.folder} has no whole episode to learn a predictor from")
    later = np.cumsum(index["steps"][rows][::-1])[::-1] - index["steps"][rows]
    return log.read(rows[later < frames].tolist(), percepts=True)


def with_percepts(episode: Episode) -> Episode:
    """The episode with states ``(T + 1, S + P)`` that go on with the percepts, where these are not the states."""
    if episode.percepts is None:
        return episode
    return replace(episode, states=np.concatenate([episode.states, episode.percepts], axis=1), percepts=None)


@dataclass(frozen=True)
class ActionColumns:
    """Actions as columns: one-hot for each choice, the numbers of a continuous action.

    Attributes:
        size: ``A`` columns.
        choices: the size and the first value of each choice; empty: continuous.
    """

    size: int
    choices: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(cls, space: gymnasium.Space[Any]) -> ActionColumns:
        """The columns of an action space.

        Raises:
            ConfigError: if it is none of Discrete, MultiDiscrete, MultiBinary and Box.
        """
        if isinstance(space, gymnasium.spaces.Discrete):
            return cls(int(space.n), ((int(space.n), int(space.start)),))
        if choices := tuple(choices_of(space)):
            return cls(sum(n for n, _ in choices), choices)
        if isinstance(space, gymnasium.spaces.Box):
            return cls(int(np.prod(space.shape)))
        raise ConfigError(f"predictor: env has actions {space}; a learned predictor allows a row of choices or a Box")

    def __call__(self, actions: Array) -> Array:
        """Actions ``(N,)`` or ``(N, ...)`` to ``(N, A)`` float32."""
        if not self.choices:
            return actions.reshape(len(actions), self.size).astype(np.float32, copy=False)
        chosen = actions.reshape(len(actions), len(self.choices)).T
        parts = [np.eye(n, dtype=np.float32)[row - first] for row, (n, first) in zip(chosen, self.choices, strict=True)]
        return np.concatenate(parts, axis=1)


@dataclass(frozen=True)
class Steps:
    """``T`` steps of several episodes.

    Attributes:
        states: ``(T, S)`` float32 before each step.
        actions: ``(T, A)`` float32 columns.
        after: ``(T, S)`` float32 after each step.
        ended: ``(T,)`` float32, 1 where the environment ended the episode with this step.
        episode: ``(T,)`` number of the episode, from 0.
    """

    states: Array
    actions: Array
    after: Array
    ended: Array
    episode: Array

    @classmethod
    def of(cls, episodes: Sequence[Episode], columns: ActionColumns) -> Steps:
        """Concatenate all steps of episodes."""
        lengths = [len(episode) for episode in episodes]
        ended = np.zeros(sum(lengths), np.float32)
        ended[np.cumsum(lengths) - 1] = [episode.terminated for episode in episodes]
        return cls(
            states=np.concatenate([episode.states[:-1] for episode in episodes]).astype(np.float32),
            actions=columns(np.concatenate([episode.actions for episode in episodes])),
            after=np.concatenate([episode.states[1:] for episode in episodes]).astype(np.float32),
            ended=ended,
            episode=np.repeat(np.arange(len(episodes)), lengths),
        )


def held_out(episodes: Sequence[Episode], every: int = 10) -> tuple[list[Episode], list[Episode]]:
    """Hold out one episode in ``every``; a single episode is used for both."""
    kept = list(episodes[::every])
    learnt = [episode for row, episode in enumerate(episodes) if row % every]
    return learnt or kept, kept
