"""How far ahead to explain: as many steps as movements last, found in the episodes themselves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ibe_rl.types import Array

FEWEST_STEPS = 5
EPISODE_SHARE = 5
"""At most a fifth of an episode is looked ahead, so that most windows lie inside one."""
HARDLY_FURTHER = 1.25
"""Going on for as long again: a straight movement gets twice as far, a random one 1.4 times, one that turns less."""
MAX_ROWS = 10_000
"""States that are looked at, of the first episodes."""


def find_horizon(states: Sequence[Array], axes: Array) -> int:
    """Find the number of steps that movements last.

    It is the least n after which it hardly pays to look further: over 2 n steps the state goes on average at most
    ``HARDLY_FURTHER`` times as far along an axis as over the first n of them. A pendulum that swings gives a bit
    more than a quarter of its period. Movements that go one way for as long as the episode lasts have no such n, and
    then a fifth of the median episode is taken.

    Args:
        states: ``(T + 1, S)`` of each episode, of the best ones.
        axes: ``(S, d)`` on which the instructor's choice of words turns; the axis with the shortest movements counts.

    Returns:
        n, at least ``FEWEST_STEPS`` and at most a fifth of the median episode; as many steps as the median episode
        has if these are fewer than ``FEWEST_STEPS``.

    Raises:
        ValueError: without any episode that has a step.
    """
    lengths = [len(each) - 1 for each in states if len(each) > 1]
    if not lengths:
        raise ValueError("find_horizon needs an episode with a step")
    median = max(1, int(np.median(lengths)))
    most = max(min(FEWEST_STEPS, median), median // EPISODE_SHARE)
    shown = _first_rows(states)
    episode = np.repeat(np.arange(len(shown)), [len(each) for each in shown])
    places = np.concatenate([np.asarray(each, float) for each in shown]) @ axes
    found = [_turns_after(places[:, axis], episode, most) for axis in range(places.shape[1])]
    return min([most, *found])


def instruction_lasts(instructions: Sequence[Array]) -> int | None:
    """How many more steps an instruction stands, from where it is heard: what it brings about ends with it.

    A roll-out holds the instruction; further ahead than this it foretells what will not be asked for any more.

    Args:
        instructions: ``(T, d)`` of each episode, 0 in silence.

    Returns:
        the median over all steps with an instruction other than 0, at least ``FEWEST_STEPS``, of the number that
        changes soonest; None if there is no such step.
    """
    left = [
        _steps_left(np.concatenate([np.sign(each[:, number]), [np.nan]]))
        for each in instructions
        for number in range(each.shape[1])
    ]
    size = max((each.shape[1] for each in instructions), default=0)
    medians = [np.median(each) for each in (np.concatenate(left[number::size]) for number in range(size)) if len(each)]
    return max(FEWEST_STEPS, int(min(medians))) if medians else None


def _steps_left(signs: Array) -> Array:
    """At each step ``(K,)`` of ``(T,)`` with an instruction, how long until it is another one; the last is none."""
    changes = np.flatnonzero(signs[1:] != signs[:-1]) + 1
    steps = np.flatnonzero(signs[:-1] != 0)
    left: Array = changes[np.searchsorted(changes, steps, side="right")] - steps
    return left


def leading_change(states: Sequence[Array], kept: Array) -> Array:
    """The direction ``(S, 1)`` in which the state changes most, each dimension in units of how much it changes.

    For data in which the instructor's words turn on nothing.

    Args:
        states: ``(T + 1, S)`` of each episode.
        kept: ``(S,)`` bool, the dimensions that count.
    """
    changes = np.concatenate([np.diff(np.asarray(each, float), axis=0) for each in _first_rows(states)])
    spread = changes.std(axis=0)
    scale = np.divide(kept, spread, out=np.zeros_like(spread), where=spread > 0)
    standard = (changes - changes.mean(axis=0)) * scale
    _, directions = np.linalg.eigh(standard.T @ standard)
    return np.asarray(scale * directions[:, -1])[:, None]


def _first_rows(states: Sequence[Array]) -> list[Array]:
    """The first episodes, until they have ``MAX_ROWS`` rows together; at least one."""
    before = np.cumsum([0, *(len(each) for each in states)])[:-1]
    return [each for each, rows in zip(states, before, strict=True) if rows < MAX_ROWS]


def _turns_after(place: Array, episode: Array, most: int) -> int:
    """The least n at which going on hardly leads further, ``most`` if there is none; places ``(N,)``."""
    for steps in range(min(FEWEST_STEPS, most), most):
        starts = np.flatnonzero(episode[2 * steps :] == episode[: -2 * steps])
        near, far = (np.abs(place[starts + n] - place[starts]).sum() for n in (steps, 2 * steps))
        if near > 0 and far <= HARDLY_FURTHER * near:
            return steps
    return most
