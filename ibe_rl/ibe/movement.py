"""What an instruction brought about: the unit in which movements are said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.ibe.meaning import Meaning
from ibe_rl.ibe.space import TooLittleDataError
from ibe_rl.types import Array

SMALLEST_UNIT = 0.5
"""Of the mean movement under an instruction: what +1 brings about counts as no less, where little is followed."""


def typical_movement(places: Array, instruction: Array, weight: Array) -> Array:
    """How far one unit of instruction moved, along each axis: least squares through no movement without instruction.

    Args:
        places: ``(W, d)`` changes along the axes.
        instruction: ``(W, d)``.
        weight: ``(W,)`` of each window.

    Raises:
        TooLittleDataError: if an axis had no instruction but 0, or its instructions moved nothing.
    """
    squares = weight @ instruction**2
    moved = np.divide(weight @ (places * instruction), squares, out=np.zeros_like(squares), where=squares > 0)
    if not np.all(np.abs(moved) > 0):
        raise TooLittleDataError("in the best episodes no instruction but 0 has moved anything yet")
    return moved


def movement_of_one(places: Array, instruction: Array, weight: Array, meanings: Sequence[Meaning]) -> Array:
    """As ``typical_movement``, but where the meaning is known above 0, and no less than ``SMALLEST_UNIT`` allows.

    Where the meaning is known the axis points the way that +1 asks for, whichever way the windows went.

    Args:
        places: ``(W, d)`` changes along the axes.
        instruction: ``(W, d)``.
        weight: ``(W,)`` of each window.
        meanings: of the ``d`` numbers; empty: of none it is known.

    Raises:
        TooLittleDataError: as ``typical_movement``.
    """
    moved = typical_movement(places, instruction, weight)
    if not meanings:
        return moved
    told = weight[:, None] * (instruction != 0)
    least = SMALLEST_UNIT * (told * np.abs(places)).sum(axis=0) / told.sum(axis=0)
    return np.where([one.known for one in meanings], np.maximum(moved, least), moved)
