"""The colour and the place of each phrase on the page: from -1 to +1 as in the live view, and what is unknown last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.shares import phrase_shares
from ibe_rl.task import Task
from ibe_rl.types import CANNOT_TELL, DOES_NOT_KNOW
from ibe_rl.view import palette
from ibe_rl.view.wording import SILENCE

NOT_SPOKEN = (DOES_NOT_KNOW, CANNOT_TELL)
Colours = dict[str, tuple[int, int, int]]


def phrase_colours(played: Sequence[PlayedEpisode], task: Task) -> Colours:
    """Colours of all phrases that were said or came, in the order in which a bar shows them.

    Numbers: by the mean expression with the phrase, blue for -1 and orange for +1. Words: one colour each, the most
    frequent first.
    """
    words = np.concatenate([np.array([*one.said, *one.came], object) for one in played])
    expressions = np.concatenate([values for one in played for values in (one.expressions, one.came_expressions)])
    there = phrase_shares(words)
    phrases = [each for each in there if each not in NOT_SPOKEN]
    if task.words is None and phrases:
        means = np.array([expressions[words == each].mean(axis=0) for each in phrases])
        order = np.lexsort(means.T[::-1]).tolist()
        phrases, shades = [phrases[i] for i in order], palette.of_expressions(means[order])
    else:
        shades = palette.of_clusters(np.arange(len(phrases)))
    found: Colours = {each: tuple(shade) for each, shade in zip(phrases, shades.tolist(), strict=True)}
    return found | {each: palette.SILENT_GREY for each in NOT_SPOKEN if each in there}


def told_colours(played: Sequence[PlayedEpisode], task: Task) -> Colours:
    """Colours of what was told; none of words, which have the colour of the same word when it is said."""
    if task.words is not None:
        return {}
    told = {word: value for one in played for word, value in zip(one.told, one.episode.instructions, strict=True)}
    shades = palette.of_expressions(np.array([*told.values()])).tolist()
    return {word: tuple(shade) for word, shade in zip(told, shades, strict=True) if word != SILENCE}
