"""Text and round numbers in the pictures that have axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

Colour = tuple[int, int, int]
Text = tuple[tuple[float, float], str, Colour]
"""Place, words and colour."""
LABEL_DROP = 0.11
"""From a point to the middle of the label below it, in hundreds of pixels."""
_TINY = 1e-9


def round_steps(low: float, high: float, count: int) -> list[float]:
    """Round numbers from ``low`` to ``high`` at equal distances, at most ``count`` + 1 of them.

    >>> round_steps(0.0, 250.0, 4)
    [0.0, 100.0, 200.0]
    """
    least = max(high - low, _TINY) / count
    power = 10.0 ** np.floor(np.log10(least))
    step = min(power * factor for factor in (1, 2, 2.5, 5, 10) if power * factor >= least * (1 - _TINY))
    first, last = np.ceil(low / step - _TINY), np.floor(high / step + _TINY)
    return [round(float(i * step), 10) + 0.0 for i in np.arange(first, last + 1)]


def labelled(texts: Sequence[Text]) -> rr.Points2D:
    """Text without a dot that is seen; each has its place, its words and its colour."""
    places, words, shades = zip(*texts, strict=True) if texts else ((), (), ())
    return rr.Points2D(places, labels=words, colors=shades, radii=rr.Radius.ui_points(0.1), show_labels=True)
