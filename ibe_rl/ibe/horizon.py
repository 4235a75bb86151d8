"""How far ahead to explain: as many steps as movements and instructions last in the episodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.types import Array

MIN_HORIZON_STEPS = 5
MAX_HORIZONS_PER_EPISODE = 5
"""The horizon is at most a fifth of an episode, so that most windows lie inside one."""
MAX_DISTANCE_RATIO = 1.25
"""Distance over 2 n steps relative to n steps: 2 for a straight movement, 1.4 for a random walk, less if it turns."""
MAX_STATES = 10_000
"""The first episodes with so many states are read."""


def find_horizon(states: Sequence[Array], axes: Array) -> int:
    """Find the number of steps that movements last.

    It is the least n for which the state moves on average at most ``MAX_DISTANCE_RATIO`` times as far along an axis
    over 2 n steps as over n. For a pendulum this is a bit more than a quarter of its period. If there is no such n,
    it is a fifth of the median episode.

    Args:
        states: ``(T + 1, S)`` of each of the best episodes.
        axes: ``(S, d)`` on which the instruction depends; the axis with the shortest movements counts.

    Returns:
        n, at least ``MIN_HORIZON_STEPS`` and at most a fifth of the median episode; the length of the median episode
        if that is shorter than ``MIN_HORIZON_STEPS``.

    Raises:
        ValueError: without any episode that has a step.
    """
    lengths = [len(each) - 1 for each in states if len(each) > 1]
    if not lengths:
        raise ValueError("find_horizon needs an episode with a step")
    median = max(1, int(np.median(lengths)))
    most = max(min(MIN_HORIZON_STEPS, median), median // MAX_HORIZONS_PER_EPISODE)
    shown = _first_rows(states)
    episode = np.repeat(np.arange(len(shown)), [len(each) for each in shown])
    places = np.concatenate([np.asarray(each, float) for each in shown]) @ axes
    found = [_turns_after(places[:, axis], episode, most) for axis in range(places.shape[1])]
    return min([most, *found])


def instruction_lasts(instructions: Sequence[Array]) -> int | None:
    """For how many more steps an instruction keeps its sign, the median over all steps with one.

    A roll-out holds the instruction constant, so a longer horizon would predict under an outdated instruction.
    ``instructions`` are ``(T, d)`` of each episode, 0 in silence.

    Returns:
        The shortest median of the ``d`` numbers, at least ``MIN_HORIZON_STEPS``; None if all instructions are 0.
    """
    left = [
        _steps_left(np.concatenate([np.sign(each[:, number]), [np.nan]]))
        for each in instructions
        for number in range(each.shape[1])
    ]
    size = max((each.shape[1] for each in instructions), default=0)
    medians = [np.median(each) for each in (np.concatenate(left[number::size]) for number in range(size)) if len(each)]
    return max(MIN_HORIZON_STEPS, int(min(medians))) if medians else None


def _steps_left(signs: Array) -> Array:
    """Steps until the sign changes, ``(K,)`` for those of the ``(T,)`` signs that are not 0; a nan ends the episode."""
    changes = np.flatnonzero(signs[1:] != signs[:-1]) + 1
    steps = np.flatnonzero(signs[:-1] != 0)
    left: Array = changes[np.searchsorted(changes, steps, side="right")] - steps
    return left


def leading_change(states: Sequence[Array], kept: Array) -> Array:
    """The first principal component ``(S, 1)`` of the standardised changes of the state in one step.

    It stands in for the axes where the instruction does not depend on the state. ``states`` are ``(T + 1, S)`` of each
    episode; ``kept`` ``(S,)`` bool are the dimensions that count.
    """
    changes = np.concatenate([np.diff(np.asarray(each, float), axis=0) for each in _first_rows(states)])
    spread = changes.std(axis=0)
    scale = np.divide(kept, spread, out=np.zeros_like(spread), where=spread > 0)
    standard = (changes - changes.mean(axis=0)) * scale
    _, directions = np.linalg.eigh(standard.T @ standard)
    return np.asarray(scale * directions[:, -1])[:, None]


def _first_rows(states: Sequence[Array]) -> list[Array]:
    """The first episodes, until they have ``MAX_STATES`` rows together; at least one."""
    before = np.cumsum([0, *(len(each) for each in states)])[:-1]
    return [each for each, rows in zip(states, before, strict=True) if rows < MAX_STATES]


def _turns_after(place: Array, episode: Array, most: int) -> int:
    """The least n after which the places ``(N,)`` turn, see ``find_horizon``; ``most`` if there is none."""
    for steps in range(min(MIN_HORIZON_STEPS, most), most):
        starts = np.flatnonzero(episode[2 * steps :] == episode[: -2 * steps])
        near, far = (np.abs(place[starts + n] - place[starts]).sum() for n in (steps, 2 * steps))
        if near > 0 and far <= MAX_DISTANCE_RATIO * near:
            return steps
    return most
