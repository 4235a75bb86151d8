"""What is drawn: an episode flown to be watched, and the outlines in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ibe_rl.data import Array, Episode, Moment


@dataclass(frozen=True)
class Shape:
    """A line or a closed outline to draw: ``points`` ``(P, 2)`` in scene units, y up."""

    points: Array
    colour: tuple[int, int, int]
    closed: bool = False
    radius: float = 0.03


@dataclass(frozen=True)
class Watched:
    """An episode flown for the viewer, with all that is needed to draw and to explain it.

    Attributes:
        episode: the episode itself.
        moments: ``T`` moments, one before each action.
        background: what stands still.
        figures: ``T + 1`` lists of the outlines that move, the same number with the same points each.
    """

    episode: Episode
    moments: Sequence[Moment]
    background: Sequence[Shape]
    figures: Sequence[Sequence[Shape]]
