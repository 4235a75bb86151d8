"""The moments that explanations are judged at, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ibe_rl.types import Array

SEEN_STEPS = 20
"""Steps that an observer sees before it has to predict (the paper's prediction task)."""


@dataclass(frozen=True)
class Moments:
    """``N`` moments of greedy episodes, what followed, and ``F`` sampled futures of each, over ``H`` horizons.

    Attributes:
        episode: ``(N,)`` number of the episode, from 0.
        seed: ``(N,)`` of the episode.
        step: ``(N,)`` step of the episode.
        state: ``(N, S)``.
        instruction: ``(N, d)``, 0 in silence.
        given: ``(N,)`` bool, False where the instructor said nothing.
        regular: ``(N,)`` bool, on the stride; the others are there for the observer only.
        observed: ``(N,)`` bool, as many steps before the first contact as the observer predicts.
        realised: ``(N, H, S)`` change of the state over each horizon; past the end of the episode it ends there.
        predicted: ``(N, F, H, S)`` the same in each of the futures.
        trusted: ``(N, F, H)`` bool, whether the predictor stands by them.
        horizons_steps: the ``H`` horizons, rising.
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
        """Some of the moments."""
        columns = {item.name: getattr(self, item.name)[rows] for item in fields(self)[:-1]}
        return Moments(**columns, horizons_steps=self.horizons_steps)

    def judged(self) -> Moments:
        """The moments on the stride at which there was an instruction."""
        return self[self.regular & self.given]

    def first_future(self) -> Moments:
        """The same with one future only."""
        return replace(self, predicted=self.predicted[:, :1], trusted=self.trusted[:, :1])

    def at(self, horizon_steps: int) -> int:
        """Index of a horizon in ``realised`` and ``predicted``."""
        return self.horizons_steps.index(horizon_steps)

    def real_change(self, horizon_steps: int, dimensions: Sequence[int]) -> Array:
        """Real changes ``(N, d)`` of some dimensions of the state over a horizon."""
        return self.realised[:, self.at(horizon_steps)][:, dimensions]


@dataclass(frozen=True)
class Plan:
    """Which moments are taken of an episode, and how far ahead is looked.

    Attributes:
        stride_steps: from one moment to the next.
        futures: sampled from each.
        horizons_steps: rising; the longest one is rolled out, the others are the beginnings of the same paths.
        observer_steps: how long before the first contact the observer predicts; None without observer.
    """

    stride_steps: int
    futures: int
    horizons_steps: tuple[int, ...]
    observer_steps: int | None = None


@dataclass(frozen=True)
class Spoken:
    """What one vocabulary says at ``N`` moments about one horizon.

    Attributes:
        expression: ``(N, d)`` of the first future alone, which the motion is judged by.
        true: ``(N,)`` bool, whether the vocabulary calls what really happened as it calls this future.
        phrase: ``(N,)`` what is said: the most frequent phrase among the futures.
        which: ``(N,)`` the first of the futures that is called so.
        said: ``(N, d)`` the expression of that one.
        voted_true: ``(N,)`` bool, whether it went as what is said predicts.
        agreement: ``(N,)`` share of the futures that are called so and that the predictor stands by.
        purity: ``(N,)`` the mapping's own confidence in it.
        known: ``(N,)`` bool, whether the meaning of what is said is known; if not, it is not said.
        first_known: ``(N,)`` the same of the first future.
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

    @property
    def features(self) -> Array:
        """``(N, 2)``, see ``explainer.CONFIDENCE_FEATURES``."""
        return np.column_stack([self.agreement, self.purity])
