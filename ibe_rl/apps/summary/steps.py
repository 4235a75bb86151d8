"""All steps of the played episodes as one table, and shares over parts of it, with intervals.

Shapes: ``N`` steps, ``E`` episodes, ``R`` resamples of the episodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.evaluation.rows import estimate_json
from ibe_rl.metrics.bootstrap import episode_weights, ratio
from ibe_rl.types import Array

THIRDS = ("first third", "middle third", "last third")
CONTACT = ("before first contact", "from first contact on")
Estimated = dict[str, float | None]
"""A value with its interval, as in JSON."""


@dataclass(frozen=True)
class StepTable:
    """Columns ``(N,)`` over all steps of the episodes.

    Attributes:
        episode: 0 to ``E`` - 1.
        step: within the episode.
        context: of the episode.
        third: 0, 1 or 2, of the length of its episode.
        touched: whether the step of first contact is reached.
        told: the instruction in words.
        said: what was said.
        came: the phrase of what then happened.
        true: whether it came as said; NaN where nothing was said.
        against: whether it went another way than told; NaN where not counted.
        said_against: the same of what was said.
        weights: ``(R, E)`` of the episodes on each resample.
    """

    episode: Array
    step: Array
    context: Array
    third: Array
    touched: Array
    told: Array
    said: Array
    came: Array
    true: Array
    against: Array
    said_against: Array
    weights: Array

    def __len__(self) -> int:
        return len(self.episode)

    def everywhere(self) -> Array:
        """All of the steps, ``(N,)`` bool."""
        return np.ones(len(self), bool)

    def phases(self) -> dict[str, Array]:
        """The phases of an episode, ``(N,)`` bool: its thirds, and where it has one also before and after contact."""
        found = {name: self.third == number for number, name in enumerate(THIRDS)}
        return found | (dict(zip(CONTACT, (~self.touched, self.touched), strict=True)) if self.touched.any() else {})

    def share_samples(self, values: Array, part: Array) -> Array:
        """The mean ``(R,)`` of values ``(N,)`` over the steps of a part ``(N,)`` bool that have one; else NaN."""
        counted = part & ~np.isnan(values)
        count, of = self.weights.shape[1], self.episode[counted]
        sums = np.bincount(of, weights=values[counted], minlength=count)
        return ratio(self.weights @ sums, self.weights @ np.bincount(of, minlength=count).astype(float))

    def share(self, values: Array, part: Array) -> Estimated:
        """The same as a value with its interval, which the steps of a single episode do not have."""
        samples = self.share_samples(values, part)
        several = len(np.unique(self.episode[part & ~np.isnan(values)])) > 1
        return estimate_json(samples if several else samples[:1])


def step_table(played: Sequence[PlayedEpisode], resamples: int, seed: int) -> StepTable:
    """The steps of the episodes."""
    lengths = [len(one) for one in played]

    def column(each: Any) -> Array:
        return np.concatenate([np.asarray(values) for values in each])

    return StepTable(
        episode=np.repeat(np.arange(len(played)), lengths),
        step=column(np.arange(length) for length in lengths),
        context=np.repeat(np.array([one.episode.context for one in played], object), lengths),
        third=column(3 * np.arange(length) // length for length in lengths),
        touched=column(touched(one) for one in played),
        told=column(np.array(one.told, object) for one in played),
        said=column(np.array(one.said, object) for one in played),
        came=column(np.array(one.came, object) for one in played),
        true=column(one.true for one in played),
        against=column(one.against for one in played),
        said_against=column(one.said_against for one in played),
        weights=episode_weights(np.arange(len(played)), resamples, seed),
    )


def touched(one: PlayedEpisode) -> Array:
    """The steps ``(T,)`` of an episode from its first contact on; none where the task declares no contact."""
    contact = len(one) if one.contact is None else one.contact
    return np.arange(len(one)) >= contact
