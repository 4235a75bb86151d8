"""The few episodes that say most about an agent: those that differ most, and what is special about each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.metrics.most_different import most_different
from ibe_rl.types import Array

WORTH_SAYING = 0.1
"""Of a column's scale: how far from the mean a value is special."""
MOST_TYPICAL, MOST_SAID = "the most typical: nearest to the mean of all", 2
"""What is said of the first one, and the parts of a line about another."""


@dataclass(frozen=True)
class Profile:
    """The episodes in numbers.

    Attributes:
        names: of the ``F`` columns.
        raw: ``(E, F)`` in their own units.
        scaled: ``(E, F)`` on one scale: shares as they are, others from 0 (the least of the episodes) to 1.
    """

    names: Sequence[str]
    raw: Array
    scaled: Array


def profile_of(played: Sequence[PlayedEpisode], judges_success: bool) -> Profile:
    """Shares of what was said, how much was not as told, success, return and length of each episode."""
    phrases = sorted({phrase for one in played for phrase in one.said})
    shares = {
        f"says “{name}”": [float(np.mean([each == name for each in one.said])) for one in played] for name in phrases
    }
    shares["does not do as told"] = [_mean_of_known(one.against) for one in played]
    if judges_success:
        shares["success"] = [float(one.episode.success) for one in played]
    lengths, returns = [float(len(one)) for one in played], [one.episode.total_reward for one in played]
    columns = {**shares, "length": lengths, "return": returns}
    raw = np.array([*columns.values()], float).T
    scaled = raw.copy()
    scaled[:, -2:] = _from_0_to_1(raw[:, -2:])
    return Profile([*columns], raw, scaled)


def _mean_of_known(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else 0.0


def _from_0_to_1(values: Array) -> Array:
    spread = np.ptp(values, axis=0)
    return (values - values.min(axis=0)) / np.where(spread > 0, spread, 1)


def telling_episodes(played: Sequence[PlayedEpisode], judges_success: bool, count: int) -> list[dict[str, Any]]:
    """The most typical episode, then those that differ most from the ones before; what is special about each."""
    profile = profile_of(played, judges_success)
    chosen = most_different(profile.scaled, count)
    return [
        {
            "number": row,
            "seed": played[row].seed,
            "context": played[row].episode.context,
            "success": bool(played[row].episode.success) if judges_success else None,
            "steps": len(played[row]),
            "return": round(played[row].episode.total_reward, 3),
            "special": MOST_TYPICAL if row == chosen[0] else what_is_special(profile, row),
        }
        for row in chosen
    ]


def what_is_special(profile: Profile, row: int) -> str:
    """One line: in what an episode is farthest from the mean of all."""
    away = np.abs(profile.scaled[row] - profile.scaled.mean(axis=0))
    far = [i for i in np.argsort(-away, kind="stable")[:MOST_SAID] if away[i] > WORTH_SAYING]
    return "; ".join(_about(profile, row, int(column)) for column in far) or "like the mean of all in everything"


def _about(profile: Profile, row: int, column: int) -> str:
    name, value, mean = profile.names[column], profile.raw[row, column], profile.raw[:, column].mean()
    if name == "success":
        return f"{'succeeds' if value else 'does not succeed'}, {mean:.0%} of all do"
    if name == "length":
        return f"{value:.0f} steps, the mean is {mean:.0f}"
    if name == "return":
        return f"return {value:.1f}, the mean is {mean:.1f}"
    return f"{name} at {value:.0%} of its steps, the mean is {mean:.0%}"
