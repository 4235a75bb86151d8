"""The curves over training, drawn as pictures: against thousands of frames, with their names beside them.

A plot of rerun has the film's steps along its axis, a legend that lies on the curves, and clips the last mark.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from ibe_rl.types import Array
from ibe_rl.view import palette as colours
from ibe_rl.view.marks import LABEL_DROP, Colour, Text, labelled, round_steps

Rows = list[tuple[int, float]]
"""Frames and value; a value that is nan interrupts the curve."""

KEPT_ROWS = 200
"""Of a curve, in the picture; the recording keeps the others under ``curves``."""
FEW_ROWS = 40
"""A curve of no more has dots."""
MORE_ROWS = 1.25
"""How many times as many rows there are when the curves are drawn again without a refresh."""
LEFT, RIGHT, TOP, BOTTOM = 0.52, 1.75, 0.1, 1.75
"""Where the curves are drawn in a panel of ``SIZE``, y down; the names are to the right."""
SIZE = (2.88, 2.3)
"""Of a panel at 1440 x 900, in hundreds of pixels: what a mark or a name takes is fixed in pixels."""
NAME_HEIGHT = 0.23
NAMES_AT, COLUMN_WIDTH = (RIGHT + SIZE[0]) / 2, 0.5
AXIS_TITLE = "thousand frames"


@dataclass(frozen=True)
class Chart:
    """One picture of curves.

    Attributes:
        entity: where it is logged.
        title: of its panel, with the unit.
        curves: key of each curve to its name and colour.
        limits: lowest and highest value; None: those of the data.
        prefix: where it is given, the curves are those of clusters, and their keys this and an id.
    """

    entity: str
    title: str
    curves: Mapping[str, tuple[str, Colour]] = field(default_factory=dict)
    limits: tuple[float, float] | None = None
    prefix: str = ""

    def named(self, keys: Collection[str]) -> dict[str, tuple[str, Colour]]:
        """Of ``keys`` those in this chart, with the name and colour of each."""
        if not self.prefix:
            return {key: named for key, named in self.curves.items() if key in keys}
        ids = sorted(int(key.removeprefix(self.prefix)) for key in keys if key.startswith(self.prefix))
        shades = colours.of_clusters(np.array(ids, int)).tolist()
        return {f"{self.prefix}{name}": (f"#{name}", (*shade,)) for name, shade in zip(ids, shades, strict=True)}


class Drawing:
    """The rows of all curves so far; ``draw`` logs their pictures.

    Attributes:
        rows: of each curve by its key, thinned out as they become many.
    """

    def __init__(self, charts: Sequence[Chart]) -> None:
        self.rows: dict[str, Rows] = {}
        self._charts, self._added, self._drawn = charts, 0, 0

    def add(self, key: str, rows: Rows) -> None:
        """Take more rows of a curve."""
        known = self.rows.setdefault(key, [])
        known += rows
        self._added += len(rows)
        while len(known) > KEPT_ROWS:
            known[:] = [row for i, row in enumerate(known) if i % 2 or i == len(known) - 1]

    def due(self) -> bool:
        """True if there is so much more than was drawn that it shows."""
        return self._added >= MORE_ROWS * self._drawn and self._added > 0

    def draw(self, recording: rr.RecordingStream) -> None:
        """Log the pictures at the time that is set, if there is anything new."""
        last = max((frames for rows in self.rows.values() for frames, _ in rows), default=0)
        if self._added == self._drawn or not last:
            return
        self._drawn = self._added
        for chart in self._charts:
            named = chart.named(self.rows)
            if named:
                draw(recording, chart, [(*named[key], self.rows[key]) for key in named], last)


def draw(recording: rr.RecordingStream, chart: Chart, shown: Sequence[tuple[str, Colour, Rows]], last: int) -> None:
    """Log one chart with curves up to the frame ``last``; each has a name, a colour and rows."""
    values = [value for *_, rows in shown for _, value in rows if math.isfinite(value)]
    low, high = chart.limits or (min(values, default=0.0), max(values, default=1.0))
    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    lines = [placed(rows, last, low, high) for *_, rows in shown]
    coloured = [(line, one[1]) for line, one in zip(lines, shown, strict=True)]
    pieces = [(piece, shade) for line, shade in coloured for piece in unbroken(line)]
    dots = [
        (point, shade) for line, shade in coloured if len(line) <= FEW_ROWS for point in line[~np.isnan(line[:, 1])]
    ]
    ticks = round_steps(low, high, 4)
    heights = [float(y_of(tick, low, high)) for tick in ticks]
    grid = [[(LEFT, y), (RIGHT, y)] for y in heights] + [[(LEFT, BOTTOM), (RIGHT, BOTTOM)]]
    strips = rr.LineStrips2D(
        [*grid, *(piece for piece, _ in pieces)],
        colors=[colours.GRID] * len(grid) + [shade for _, shade in pieces],
        radii=rr.Radius.ui_points([0.4] * len(grid) + [0.9] * len(pieces)),
    )
    recording.log(f"{chart.entity}/lines", strips)
    places, colors = [point for point, _ in dots], [shade for _, shade in dots]
    recording.log(f"{chart.entity}/dots", rr.Points2D(places, colors=colors, radii=rr.Radius.ui_points(2.2)))
    ends = [(name, shade, float(line[-1, 1])) for (name, shade, _), line in zip(shown, lines, strict=True)]
    texts = [*marks(ticks, heights, last), *names([one for one in ends if math.isfinite(one[2])])]
    recording.log(f"{chart.entity}/words", labelled(texts))


def placed(rows: Rows, last: int, low: float, high: float) -> Array:
    """Rows to points ``(N, 2)`` of the picture."""
    frames, values = np.array(rows, float).T
    return np.stack([LEFT + (RIGHT - LEFT) * frames / last, y_of(np.clip(values, low, high), low, high)], axis=1)


def y_of(value: Array | float, low: float, high: float) -> Array:
    """Values to heights in the picture, y down."""
    return BOTTOM - (BOTTOM - TOP) * (np.asarray(value, float) - low) / (high - low)


def unbroken(line: Array) -> list[Array]:
    """The parts ``(P, 2)`` of a line without gaps."""
    parts = np.split(line, np.flatnonzero(~np.isfinite(line[:, 1])))
    return [part for part in (part[np.isfinite(part[:, 1])] for part in parts) if len(part) > 1]


def marks(ticks: Sequence[float], heights: Sequence[float], last: int) -> list[Text]:
    """The numbers along both axes, and what is counted along the lower one."""
    left = [((LEFT - 0.26, y - LABEL_DROP), f"{tick:g}") for tick, y in zip(ticks, heights, strict=True)]
    thousands = round_steps(0, last / 1000, 2)
    below = [((LEFT + (RIGHT - LEFT) * 1000 * tick / last, BOTTOM), f"{tick:,.6g}") for tick in thousands]
    title = ((LEFT + RIGHT) / 2, BOTTOM + 0.24), AXIS_TITLE
    return [(*one, colours.AXIS) for one in (*left, *below, title)]


def names(ends: Sequence[tuple[str, Colour, float]]) -> list[Text]:
    """The names of curves to the right of where they end, none on top of another; each with a colour and an end.

    What does not fit below one another stands in columns.
    """
    ordered = sorted(ends, key=lambda one: one[2])
    columns = max(1, math.ceil(NAME_HEIGHT * len(ordered) / (BOTTOM + 0.3)))
    places = [NAMES_AT + COLUMN_WIDTH * (column - (columns - 1) / 2) for column in range(columns)]
    return [text for column, x in enumerate(places) for text in _column(ordered[column::columns], x)]


def _column(ordered: Sequence[tuple[str, Colour, float]], x: float) -> list[Text]:
    """Names below one another, in the order of their ends."""
    room, last, texts = BOTTOM + 0.3 - NAME_HEIGHT * len(ordered), -NAME_HEIGHT, []
    for row, (name, shade, end) in enumerate(ordered):
        wanted = min(end - NAME_HEIGHT / 2, room + NAME_HEIGHT * row)
        last = max(wanted, last + NAME_HEIGHT)
        texts.append(((x, last), name, shade))
    return texts
