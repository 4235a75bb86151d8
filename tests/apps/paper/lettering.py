"""Where the words of a figure are when it is drawn."""

from __future__ import annotations

from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

PIXEL = 1.0


def drawn(figure: Figure) -> list[tuple[str, Bbox]]:
    """All words that are really drawn, in pixels; ticks beyond the limits and what is hidden are not."""
    canvas, seen, plain = FigureCanvasAgg(figure), [], Text.draw

    def note(text: Text, renderer: object, *rest: object, **more: object) -> None:
        seen.append(text)
        plain(text, renderer, *rest, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", note)
        canvas.draw()
    words = [text for text in dict.fromkeys(seen) if text.get_visible() and text.get_text().strip()]
    return [(text.get_text(), text.get_window_extent(canvas.get_renderer())) for text in words]


def cut_off(figure: Figure) -> list[str]:
    """Words that the edge of the figure cuts."""
    words, edge = drawn(figure), figure.bbox.padded(PIXEL)
    return [text for text, box in words if not (edge.containsx(box.x0) and edge.containsx(box.x1))] + [
        text for text, box in words if not (edge.containsy(box.y0) and edge.containsy(box.y1))
    ]


def on_each_other(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of words that lie on each other."""
    return [
        (one, other)
        for (one, first), (other, second) in combinations(drawn(figure), 2)
        if first.padded(-PIXEL / 2).overlaps(second.padded(-PIXEL / 2))
    ]
