"""Which colour stands for what, in the live view and in the figures alike; on a dark ground."""

from __future__ import annotations

import numpy as np

from ibe_rl.types import Array

NEGATIVE, ZERO, POSITIVE = (66, 146, 245), (160, 160, 165), (245, 134, 30)
"""Expressions -1, 0 and +1, told apart also without red or green."""
DARKER, LIGHTER = 0.5, 0.65
"""How far the second number of an expression goes towards black and white."""
LEAST_OF_LETTERS = 150
"""Of the brightest colour of letters that can be read on the background."""
INSTRUCTED, EXPLANATION = (250, 204, 21), (45, 212, 191)
GREEN, MUTED = (132, 224, 96), (130, 130, 140)
"""The best, what went as predicted; and the others."""
PINK, PALE, SILENT_GREY = (244, 114, 182), (190, 190, 200), (70, 70, 78)
BLUE, VIOLET, TRAIL = (96, 165, 250), (165, 148, 249), (150, 140, 200)
BACKGROUND, AXIS, WHITE, GRID = (13, 14, 20), (150, 150, 160), (228, 228, 235), (44, 46, 58)
LASTING = (
    *((230, 100, 140), (90, 190, 250), (250, 200, 60), (150, 120, 240), (80, 210, 160), (250, 140, 70)),
    *((200, 200, 210), (190, 90, 210), (170, 210, 80), (110, 140, 220), (220, 150, 180), (60, 170, 170)),
)
"""Of clusters, by their lasting ids."""
RUN_COLOURS = (
    *((86, 180, 233), (230, 159, 0), (0, 158, 115), (204, 121, 167)),
    *((240, 228, 66), (213, 94, 0), (0, 114, 178), (240, 240, 240)),
)
"""Of runs and conditions beside each other: Okabe and Ito's, safe for the colour-blind, white in place of black."""


def of_expressions(values: Array) -> Array:
    """Expressions in [-1, 1] to colours ``(N, 3)`` uint8.

    The first number goes from blue over grey to orange; a second one makes that darker below 0, lighter above. Others
    are not seen.

    Args:
        values: ``(N,)``, or ``(N, d)``.
    """
    values = np.clip(np.asarray(values, float), -1, 1).reshape(len(values), -1)
    first = values[:, :1]
    shades = ZERO + np.abs(first) * (np.where(first < 0, NEGATIVE, POSITIVE) - np.array(ZERO))
    if values.shape[1] > 1:
        second = values[:, 1:2]
        shades += np.where(second < 0, DARKER * second * shades, LIGHTER * second * (255 - shades))
    return shades.round().astype(np.uint8)


def legible(shades: Array) -> Array:
    """The same hues ``(N, 3)`` uint8, none too dark for letters on the background."""
    brightest = np.maximum(shades.max(axis=1, keepdims=True), 1).astype(float)
    return (shades * np.maximum(1.0, LEAST_OF_LETTERS / brightest)).round().astype(np.uint8)


def of_clusters(ids: Array) -> Array:
    """Ids ``(k,)`` to colours ``(k, 3)`` uint8 that are theirs for the whole run."""
    return np.array(LASTING, np.uint8)[np.asarray(ids) % len(LASTING)]
