"""The lander with five words that have no order: left, right, hold, faster, slower.

One word at a time: the one whose need is greatest, in units of its tolerance; hold where nothing is needed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ibe_rl.envs.lander_speed_task import (
    LANDER_SPEED_TASK,
    SPEED_TOLERANCE,
    lander_goal_offset,
    too_slow,
)
from ibe_rl.envs.lander_task import FLAG_DISTANCE
from ibe_rl.task.words import Words
from ibe_rl.types import Array

FALL_LEFT, FALL_RIGHT, HOLD, FASTER, SLOWER = range(5)
FIVE_WORDS = ("left", "right", "hold", "faster", "slower")


def say_one_word(states: Array) -> Array:
    """The most needed word.

    Args:
        states: ``(..., 9)``.

    Returns:
        ``(..., 5)`` float32, 1 for the word and 0 for the others: to the nearer side of the flags where it is beyond
        one, or the wanted sinking speed where that is farther off than its tolerance.
    """
    aside = -lander_goal_offset(states)[..., 0] / FLAG_DISTANCE
    slow = too_slow(states) / SPEED_TOLERANCE
    word = np.full(aside.shape, HOLD)
    sideways = (np.abs(aside) > 1) & (np.abs(aside) >= np.abs(slow))
    speed = (np.abs(slow) > 1) & ~sideways
    word = np.where(sideways, np.where(aside > 0, FALL_LEFT, FALL_RIGHT), word)
    word = np.where(speed, np.where(slow > 0, FASTER, SLOWER), word)
    return np.eye(len(FIVE_WORDS), dtype=np.float32)[word]


LANDER_WORDS_TASK = replace(
    LANDER_SPEED_TASK,
    name="Lunar Lander, five words",
    rule=say_one_word,
    phrases=Words(FIVE_WORDS),
    instruction_values=(0.0, 1.0),
)
