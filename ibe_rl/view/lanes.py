"""What is told and said over the steps of one episode, as a picture: a lane each, with a mark at the step shown.

A timeline of rerun calls its lanes by their entities, and counts the steps of the whole film.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ibe_rl.types import Array
from ibe_rl.view import palette as colours
from ibe_rl.view.marks import LABEL_DROP, Text, labelled, round_steps

ENTITY = "lanes"
IF_TOLD, IF_TOLD_PATHS = "what_if", "scene/what_if"
"""What it would do if it were told something else: lanes of their own, and paths in the scene."""
PICTURE_WIDTH, FIRST_X, LAST_X = 5.0, 1.2, 4.8
"""Of the picture at 1440 x 900, in hundreds of pixels; the lanes are between the other two."""
LANE_HEIGHT, BAND_HEIGHT, AXIS_HEIGHT, PEN = 0.32, 0.24, 0.42, 0.016
"""Lines of rerun have round ends: a band is hatched with a thin pen, so that it ends where it should."""
LETTER_WIDTH, SIDES = 0.068, 0.1
"""Of a label."""


@dataclass(frozen=True)
class Lane:
    """One lane: its name, and for each step the words and their colour ``(T, 3)``."""

    name: str
    words: Sequence[str]
    shades: Array


def height(lanes: int) -> float:
    """Of a picture with so many lanes."""
    return LANE_HEIGHT * lanes + AXIS_HEIGHT


def log_lanes(recording: rr.RecordingStream, lanes: Sequence[Lane], entity: str = ENTITY) -> None:
    """Draw the lanes of an episode at the time that is set."""
    steps = len(lanes[0].words)
    bands, shades, texts = [], [], []
    for row, lane in enumerate(lanes):
        starts, y = [0, *(i for i in range(1, steps) if lane.words[i] != lane.words[i - 1])], LANE_HEIGHT * (row + 0.5)
        for start, end in zip(starts, [*starts[1:], steps], strict=True):
            x, until = x_of(start, steps), x_of(end, steps)
            bands.append(hatched(x, until, y))
            shades.append(lane.shades[start])
            if LETTER_WIDTH * len(lane.words[start]) + SIDES <= until - x:  # or it would cover its neighbours
                texts.append((((x + until) / 2, y - LABEL_DROP), lane.words[start], colours.WHITE))
    strips = rr.LineStrips2D(bands, colors=np.array(shades, np.uint8), radii=PEN)
    recording.log(f"{entity}/bands", strips)
    recording.log(f"{entity}/words", labelled([*texts, *_marks(lanes, steps)]))


def hatched(left: float, right: float, y: float) -> Array:
    """One line to and fro that fills a band around ``y``: points ``(P, 2)``."""
    rows = np.arange(y - BAND_HEIGHT / 2, y + BAND_HEIGHT / 2, 1.5 * PEN)
    pen = min(PEN, (right - left) / 2)
    ends = np.tile([left + pen, right - pen, right - pen, left + pen], -(-len(rows) // 2))[: 2 * len(rows)]
    return np.stack([ends, rows.repeat(2)], axis=1)


def step_marks(steps: int, lanes: int) -> rr.ComponentColumnList:
    """For each of ``steps``, a line through all lanes there."""
    x = np.array([x_of(step, steps) for step in range(steps)], np.float32)
    ends = np.array([0.0, LANE_HEIGHT * lanes], np.float32)
    lines = np.stack(np.broadcast_arrays(x[:, None], ends[None]), axis=-1)
    return rr.LineStrips2D.columns(strips=lines)


def x_of(step: int, steps: int) -> float:
    """Where a step of an episode is."""
    return FIRST_X + (LAST_X - FIRST_X) * step / steps


def _marks(lanes: Sequence[Lane], steps: int) -> list[Text]:
    """The names of the lanes, and the steps below them."""
    bottom = LANE_HEIGHT * len(lanes)
    named = [((0.5, LANE_HEIGHT * (row + 0.5) - LABEL_DROP), lane.name) for row, lane in enumerate(lanes)]
    ticks = [int(tick) for tick in round_steps(0, 0.95 * steps, 5)]
    counted = [((x_of(tick, steps), bottom), f"{tick}" if tick else "step 0") for tick in ticks]
    return [(*one, colours.AXIS) for one in (*named, *counted)]
