"""The expected error of members given their disagreement, measured on held-out logged episodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.predict.members import Scale
from ibe_rl.predict.rolling import CHECK_EVERY_STEPS, Begin, Rolled, checks
from ibe_rl.types import Array, Episode

WINDOWS = 1_024
STEPS = 100
"""Longest horizon measured; beyond it the last values hold."""
LARGEST_ERROR = 1e6
"""Error or disagreement, in units, that no larger one adds anything to."""


@dataclass(frozen=True)
class Trust:
    """From disagreement to expected error.

    Attributes:
        spread: ``(C, G)`` standard deviation of the change of each graded dimension after each
            ``CHECK_EVERY_STEPS`` steps: the unit of errors.
        error_per_gap: expected error over disagreement, both in that unit.
    """

    spread: Array
    error_per_gap: float

    def expected_error(self, apart: Array) -> Array:
        """Disagreement ``(N, C, G)`` to the expected error ``(N, C)`` after each check."""
        return self.error_per_gap * in_units(apart, self.spread)

    def trusted_steps(self, error: Array, limit: float, horizon_steps: int) -> Array:
        """Expected errors ``(N, C)`` to the number of steps ``(N,)`` within ``limit``."""
        beyond = error > limit
        return np.where(beyond.any(axis=1), CHECK_EVERY_STEPS * beyond.argmax(axis=1), horizon_steps)


def in_units(values: Array, spread: Array) -> Array:
    """``(N, C, G)`` to the root mean square ``(N, C)`` over the dimensions, in units of ``spread`` ``(C', G)``.

    Members that have hardly learnt yet diverge within a hundred steps; what is too large for its square to be a number
    counts as ``LARGEST_ERROR``.
    """
    if not values.shape[2]:
        return np.zeros(values.shape[:2], np.float32)
    units = spread[np.minimum(np.arange(values.shape[1]), len(spread) - 1)]
    in_range = np.clip(np.nan_to_num(values / units, nan=LARGEST_ERROR), -LARGEST_ERROR, LARGEST_ERROR)
    return np.sqrt(np.mean(in_range**2, axis=2))


def measure(
    episodes: Sequence[Episode],
    scale: Scale,
    columns: Callable[[Array], Array],
    roll: Callable[[Array, Begin, int], Rolled],
    seed: int,
) -> Trust:
    """Compare rollouts of the members on logged actions with the logged states.

    Args:
        episodes: held out.
        scale: its graded dimensions are compared.
        columns: actions to columns.
        roll: start states ``(N, S)``, how to act, and a horizon to futures.
        seed: of the sample of windows.
    """
    states = np.concatenate([episode.states for episode in episodes]).astype(np.float32)
    last = np.repeat(np.cumsum([len(episode) + 1 for episode in episodes]) - 1, [len(each) + 1 for each in episodes])
    actions = np.concatenate([columns(episode.actions[[*range(len(episode)), -1]]) for episode in episodes])
    rows = np.random.default_rng(seed).permutation(np.flatnonzero(np.arange(len(last)) < last))[:WINDOWS]

    def begin(futures: Array) -> Callable[[int, Array], Array]:
        start = rows[futures]
        return lambda step, _: actions[np.minimum(start + step, last[start])]

    steps, graded = CHECK_EVERY_STEPS * np.arange(1, checks(STEPS) + 1), scale.graded
    real = states[np.minimum(rows[:, None] + steps, last[rows][:, None])][..., graded]
    spread = np.maximum((real - states[rows][:, None, graded]).std(axis=0), scale.step[graded])
    rolled = roll(states[rows], begin, STEPS)
    error = in_units(rolled.paths[:, steps][..., graded] - real, spread)
    gap = in_units(rolled.apart, spread)
    return Trust(spread, float(error.mean() / max(float(gap.mean()), 1e-9)))
