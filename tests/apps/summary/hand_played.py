"""Episodes in words made by hand: what was told, said and came is written down, one letter a step."""

from __future__ import annotations

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.task import RecordedRollout
from ibe_rl.types import DOES_NOT_KNOW, Episode

PHRASES = {"u": "going up", "s": "staying", "d": "going down", "?": DOES_NOT_KNOW}
VALUES = {"u": 1.0, "s": 0.0, "d": -1.0, "?": 0.0}
SILENT = "-"


def played(
    told: str,
    said: str,
    came: str,
    seed: int = 0,
    context: str = "lower",
    success: bool = True,
    reward: float = 1.0,
    contact: int | None = None,
) -> PlayedEpisode:
    """An episode of as many steps as letters."""
    steps = len(said)
    given = np.array([one != SILENT for one in told])
    value = np.array([[VALUES.get(one, 0.0)] for one in told])
    states = np.zeros((steps + 1, 3))
    episode = Episode(states, np.zeros(steps), np.full(steps, reward), value, given, True, success, context)
    known = np.array([one != "?" for one in said])
    return PlayedEpisode(
        seed=seed,
        watched=RecordedRollout(episode, [], [], [[]] * (steps + 1)),
        told=[PHRASES.get(one, "(silent)") for one in told],
        said=[PHRASES[one] for one in said],
        came=[PHRASES[one] for one in came],
        expressions=np.array([[VALUES[one]] for one in said]),
        came_expressions=np.array([[VALUES[one]] for one in came]),
        known=known,
        against=np.where(given, [a != b for a, b in zip(told, came, strict=True)], np.nan),
        said_against=np.where(given & known, [a != b for a, b in zip(told, said, strict=True)], np.nan),
        contact=contact,
        paths=np.zeros((-(-steps // 3), 2, 3)),
    )
