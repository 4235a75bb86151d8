"""The moments that explanations are evaluated at, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ibe_rl.types import Array, Moment

SEEN_STEPS = 20
"""Steps that an observer sees before its prediction (the paper's prediction task)."""
FUTURES_AT_ONCE = 640
"""Futures predicted between two steps of the progress bar."""


@dataclass(frozen=True)
class TakenMoment:
    """A moment with its real future, known once the episode is over."""

    moment: Moment
    episode: int
    seed: int
    step: int
    regular: bool
    observed: bool
    realised: np.ndarray


@dataclass(frozen=True)
class Moments:
    """``N`` moments of greedy episodes, their real future and ``F`` sampled futures, over ``H`` horizons.

    Attributes:
        episode: ``(N,)`` number of the episode, from 0.
        seed: ``(N,)`` seed of the episode.
        step: ``(N,)`` step of the episode.
        state: ``(N, S)``.
        instruction: ``(N, d)``, 0 without an instruction.
        given: ``(N,)`` bool, False without an instruction.
        regular: ``(N,)`` bool, on the stride; the others serve the observer only.
        observed: ``(N,)`` bool, the moment of the observer's prediction, a fixed time before the first contact.
        realised: ``(N, H, S)`` change of the state over each horizon, or to the end of the episode if that is sooner.
        predicted: ``(N, F, H, S)`` the same in each sampled future.
        trusted: ``(N, F, H)`` bool, whether the predictor trusts its prediction.
        horizons_steps: the ``H`` horizons, ascending.
    """

    episode: Array
    seed: Array
    step: Array
    state: Array
    instruction: Array
    given: Array
    regular: Array
    observed: Array
    realised: Array
    predicted: Array
    trusted: Array
    horizons_steps: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.step)

    def __getitem__(self, rows: Array) -> Moments:
        """The moments of the given rows."""
        columns = {item.name: getattr(self, item.name)[rows] for item in fields(self)[:-1]}
        return Moments(**columns, horizons_steps=self.horizons_steps)

    def judged(self) -> Moments:
        """The moments on the stride with an instruction."""
        return self[self.regular & self.given]

    def first_future(self) -> Moments:
        """The same moments with one future only."""
        return replace(self, predicted=self.predicted[:, :1], trusted=self.trusted[:, :1])

    def at(self, horizon_steps: int) -> int:
        """Index of a horizon in ``realised`` and ``predicted``."""
        return self.horizons_steps.index(horizon_steps)

    def real_change(self, horizon_steps: int, dimensions: Sequence[int]) -> Array:
        """Real changes ``(N, d)`` of some dimensions of the state over a horizon."""
        return self.realised[:, self.at(horizon_steps)][:, dimensions]


@dataclass(frozen=True)
class Plan:
    """Which moments of an episode to take, and their horizons.

    Attributes:
        stride_steps: from one moment to the next.
        futures: number sampled from each moment.
        horizons_steps: ascending; only the longest is rolled out, the others are prefixes of the same paths.
        observer_steps: from the observer's prediction to the first contact; None without observer.
    """

    stride_steps: int
    futures: int
    horizons_steps: tuple[int, ...]
    observer_steps: int | None = None


@dataclass(frozen=True)
class Spoken:
    """The explanations of one vocabulary at ``N`` moments for one horizon.

    Attributes:
        expression: ``(N, d)`` the mean over the futures, for the motion metrics; see ``mean_movements``.
        true: ``(N,)`` bool, whether the real change has the same phrase as the first future.
        phrase: ``(N,)`` the explanation: the most frequent phrase among the futures.
        which: ``(N,)`` index of the first future with that phrase.
        said: ``(N, d)`` the expression of that future.
        voted_true: ``(N,)`` bool, whether the real change has the phrase of the explanation.
        agreement: ``(N,)`` share of the futures that have this phrase and are trusted by the predictor.
        purity: ``(N,)`` the mapping's own confidence in it.
        known: ``(N,)`` bool, whether the meaning of the phrase is known; if not, it is not used.
        first_known: ``(N,)`` the same of the first future's phrase.
        word: ``(N,)`` of words, the slot of the one that fits the first future best.
        real_word: ``(N,)`` the same of the real change.
        told_word: ``(N,)`` the same of the instruction.
    """

    expression: Array
    true: Array
    phrase: Array
    which: Array
    said: Array
    voted_true: Array
    agreement: Array
    purity: Array
    known: Array
    first_known: Array
    word: Array
    real_word: Array
    told_word: Array

    @property
    def features(self) -> Array:
        """``(N, 2)``, see ``explainer.CONFIDENCE_FEATURES``."""
        return np.column_stack([self.agreement, self.purity])
