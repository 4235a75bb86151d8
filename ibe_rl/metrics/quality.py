"""Does what was said happen?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.data import Array, Episode, Explanation, Mapping, Phrases
from ibe_rl.ibe import delta_states, phrase


def phrases_true(
    episode: Episode, said: Sequence[Explanation], mapping: Mapping, vocabulary: Sequence[Phrases]
) -> Array:
    """At which moments of an episode the spoken phrase is the phrase of what then happened.

    What happened is measured over the same horizon, to the end of the episode where that is shorter, and put
    into words by the same mapping.

    Args:
        episode: ``T`` steps.
        said: ``T`` explanations, one before each step.
        mapping: the mapping they were made with.
        vocabulary: the words they were made with.

    Returns:
        ``(T,)`` bool.
    """
    realised = delta_states(episode.states, said[0].horizon_steps, end="clamp")
    happened = [phrase(expression, vocabulary) for expression in mapping.express(realised)]
    return np.array([one.phrase == other for one, other in zip(said, happened, strict=True)])


def came_true(
    episode: Episode, said: Sequence[Explanation], mapping: Mapping, vocabulary: Sequence[Phrases], every_steps: int = 1
) -> float:
    """Share of the moments at which ``phrases_true`` holds, of those that something new was said at."""
    return float(np.mean(phrases_true(episode, said, mapping, vocabulary)[::every_steps]))
