"""What the log says about an instructor: who said what in which state, what moved then, and what it earned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.ibe.delta import delta_states
from ibe_rl.types import Array, Episode


@dataclass(frozen=True)
class Record:
    """The steps of ``E`` episodes, ``N`` together, one window of ``horizon_steps`` beginning at each.

    Attributes:
        states: ``(N, S)`` at the beginning of each window.
        after: ``(N, S)`` one step later.
        delta: ``(N, S)`` change of the state over the window, or to the end of the episode.
        told: ``(N, d)`` the instruction at its beginning, 0 in silence.
        given: ``(N,)`` bool.
        whole: ``(N,)`` bool, whether the window ends within its episode.
        step: ``(N,)`` at which it begins.
        episode: ``(N,)`` index of its episode.
        earned: ``(N,)`` rewards over the window.
        returns: ``(E,)`` total rewards.
        contexts: ``(E,)`` names.
        horizon_steps: n.
    """

    states: Array
    after: Array
    delta: Array
    told: Array
    given: Array
    whole: Array
    step: Array
    episode: Array
    earned: Array
    returns: Array
    contexts: Array
    horizon_steps: int

    @classmethod
    def of(cls, episodes: Sequence[Episode], horizon_steps: int) -> Record:
        """Read whole episodes of one environment, good and bad ones.

        Args:
            episodes: at least one.
            horizon_steps: n, at least 1.

        Raises:
            ValueError: without any episode, or for a horizon below 1.
        """
        if not episodes:
            raise ValueError("a record needs at least one episode")
        counts = [len(one) for one in episodes]
        step = np.concatenate([np.arange(count) for count in counts])
        given = np.concatenate([one.given for one in episodes]).astype(bool)
        return cls(
            states=np.concatenate([one.states[:-1] for one in episodes]).astype(float),
            after=np.concatenate([one.states[1:] for one in episodes]).astype(float),
            delta=np.concatenate([delta_states(one.states, horizon_steps, "clamp") for one in episodes]).astype(float),
            told=np.concatenate([one.instructions for one in episodes]).astype(float) * given[:, None],
            given=given,
            whole=step + horizon_steps <= np.repeat(counts, counts),
            step=step,
            episode=np.repeat(np.arange(len(episodes)), counts),
            earned=np.concatenate([_earned(one.rewards, horizon_steps) for one in episodes]),
            returns=np.array([one.total_reward for one in episodes]),
            contexts=np.array([one.context for one in episodes]),
            horizon_steps=horizon_steps,
        )

    def __len__(self) -> int:
        return len(self.states)

    @property
    def size(self) -> int:
        """``E``, the number of episodes."""
        return len(self.returns)

    def signs(self, number: int) -> Array:
        """Which way ``(N,)`` one number of the instruction asks for: -1, 0 or 1."""
        return np.sign(self.told[:, number])

    def last_heard(self, number: int) -> Array:
        """The last step ``(N,)`` of each window at which the instructor is heard; the first one if never again.

        Silence is 0 for an instructor who never says 0.
        """
        heard = self.given | (not (self.signs(number)[self.given] == 0).any())
        rows = np.arange(len(self))
        ends = np.searchsorted(self.episode, self.episode, side="right") - 1
        newest = np.maximum.accumulate(np.where(heard, rows, 0))
        return np.maximum(newest[np.minimum(rows + self.horizon_steps, ends)], rows)

    def onsets(self, number: int) -> Array:
        """Steps ``(M,)`` at which the instructor says another way than at the step before, and said one at both."""
        signs = self.signs(number)
        same = (np.diff(self.episode) == 0) & self.given[1:] & self.given[:-1]
        return np.flatnonzero(same & (np.diff(signs) != 0)) + 1


def _earned(rewards: Array, horizon_steps: int) -> Array:
    """Sums ``(T,)`` of the next rewards, to the end of the episode where it is shorter."""
    until = np.concatenate([[0.0], np.cumsum(rewards, dtype=float)])
    steps = np.arange(len(rewards))
    sums: Array = until[np.minimum(steps + horizon_steps, len(rewards))] - until[steps]
    return sums
