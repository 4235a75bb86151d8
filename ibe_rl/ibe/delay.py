"""How late an instructor is, from the log alone: at which delay the state explains best what was said.

A rule reads few dimensions of the state. Late instructions also look like a rule of today's place and velocity, as the
two give the place of a while ago. So a delay is believed with the fewest dimensions that explain what was said. How
well they do is the mutual information of what was said and a partition of the state: mistakes and silence lower it at
every delay alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ibe_rl.ibe.rule_parts import (
    axes_of,
    gains,
    information_of,
    levels_of,
    part_of,
    partition,
    ranked_parts,
    supports,
)
from ibe_rl.types import Array, Episode

MOST_DELAY_STEPS, SHARE_OF_EPISODE = 100, 0.5
"""Longer delays, also longer ones than this share of the median episode, are not looked for."""
EVERY_STEPS, BEFORE_STEPS, BEYOND_STEPS = 15, 20, 25
"""Steps between the delays at which rules are looked for; how far before 0 and beyond the best one is compared."""
PARSIMONY = 0.02
"""Share of the information that one more dimension of the state must add to be believed."""
MIN_INFORMATION, MIN_CHANGES, LEAST_SAID = 0.05, 10, 200
"""Nats a step that the state must tell of what was said, its changes, and steps: with less the log does not tell."""
LEAST_STEPS, WIDEST_STEPS, EARLY_STEPS = 6, 20, 5
"""Fewer steps count as none. A wider interval is no answer, nor are states so far ahead: they are consequences."""
BOOTSTRAPS, LOW_HIGH = 200, (2.5, 97.5)
MOST_EPISODES, LEARNT_STEPS, JUDGED_STEPS = 400, 2_500, 5_000
TRIED, CLIMBS = 4, 3


@dataclass(frozen=True)
class Delay:
    """How late an instructor is, in steps of the environment.

    Attributes:
        steps: behind what it instructs about; 0 where that cannot be told.
        low: end of the 95 % interval over episodes; 0 where it cannot be told.
        high: likewise the other end; the longest delay looked for where it cannot be told.
        known: False if the log does not tell.
    """

    steps: int
    low: int
    high: int
    known: bool = True


class _Steps(NamedTuple):
    """Joined steps of episodes: standardised states ``(N, S)``, one number of the instruction, and where.

    ``kinds`` are levels of the number and silence; ``first`` is the step of the first instruction of the episode,
    ``last`` the row of its last step; all ``(N,)``.
    """

    states: Array
    said: Array
    kinds: Array
    given: Array
    episode: Array
    step: Array
    first: Array
    last: Array

    def rows(self, from_step: int) -> Array:
        """Rows of steps from there on, once somebody has begun to instruct."""
        return np.flatnonzero(self.step >= np.maximum(from_step, self.first))

    def before(self, rows: Array, lag: int) -> Array:
        """Rows so many steps earlier, or later, at most the last of the episode."""
        return np.minimum(rows - lag, self.last[rows])


class _Rule(NamedTuple):
    """Dimensions that the instruction reads, how late it is then, and what they tell of it at each delay."""

    dimensions: list[int]
    lag: int
    told: Array


def find_delay(episodes: Sequence[Episode]) -> Delay:
    """Find how late the instructor of these episodes is: good and bad ones, the newest last, of one instructor."""
    episodes = [one for one in episodes if np.any(one.given)][-MOST_EPISODES:]
    lengths = [len(one) for one in episodes] or [0]
    most = min(MOST_DELAY_STEPS, int(SHARE_OF_EPISODE * np.median(lengths)))
    size = episodes[0].instructions.shape[1] if episodes else 0
    joined = [_joined(episodes, number) for number in range(size)]
    numbers = [one for one in joined if _tells(one, most)]
    if most < 2 or not numbers:
        return Delay(0, 0, most, known=False)
    rules = [_find_rule(one, most) for one in numbers]
    lag = int(np.sum([rule.told for rule in rules], axis=0).argmax())
    top = min(most, lag + BEYOND_STEPS)
    gained = np.zeros((len(episodes), 1))
    for _ in range(CLIMBS):
        found = sum(_gained(one, rule.dimensions, lag, top) for one, rule in zip(numbers, rules, strict=True))
        gained = max(gained, np.asarray(found), key=lambda one: float(one.sum(axis=0).max()))
        better = max(0, int(np.sum(found, axis=0).argmax()) - BEFORE_STEPS)
        if better == lag:
            break
        lag = better
    return _answer(gained, most, sum(len(one.rows(top)) for one in numbers))


def _joined(episodes: Sequence[Episode], number: int) -> _Steps:
    counts = np.array([len(one) for one in episodes])
    states = np.concatenate([one.states[:-1] for one in episodes]).astype(float)
    spread = states.std(axis=0)
    moving = spread > 1e-9 * (1 + np.abs(states).max(axis=0))
    said = np.concatenate([one.instructions[:, number] for one in episodes]).astype(float)
    given = np.concatenate([one.given for one in episodes]).astype(bool)
    return _Steps(
        states=(states - states.mean(axis=0)) / np.where(moving, spread, 1) * moving,
        said=said,
        kinds=levels_of(said, given),
        given=given,
        episode=np.repeat(np.arange(len(episodes)), counts),
        step=np.concatenate([np.arange(count) for count in counts]),
        first=np.repeat([int(np.argmax(one.given)) for one in episodes], counts),
        last=np.repeat(np.cumsum(counts) - 1, counts),
    )


def _tells(steps: _Steps, most: int) -> bool:
    """Whether enough was said, and changed within episodes, also silence."""
    rows = steps.rows(1)
    rows = rows[steps.step[rows] > steps.first[rows]]
    changes = int(np.sum(steps.kinds[rows] != steps.kinds[rows - 1]))
    learnt = [rows[(steps.episode[rows] % 2 == fold) & steps.given[rows]] for fold in (0, 1)]
    late = [steps.said[one[steps.step[one] >= most]] for one in learnt]
    return changes >= MIN_CHANGES and all(len(one) >= LEAST_SAID // 2 and np.ptp(one) > 0 for one in late)


def _some(rows: Array, most: int) -> Array:
    return np.sort(np.random.default_rng(0).permutation(rows)[:most])


def _find_rule(steps: _Steps, most: int) -> _Rule:
    """The rule that tells most with fewest dimensions, at the delay at which it tells most."""
    rows = steps.rows(most)
    learnt, judged = (rows[steps.episode[rows] % 2 == fold] for fold in (0, 1))
    judged = _some(judged, JUDGED_STEPS)
    tried = [_climb(steps, rule, learnt, judged) for rule in _candidates(steps, learnt, judged, most)]
    first = _simplest(tried)[0]
    others = [
        first._replace(lag=lag) for lag in range(0, most + 1, 2 * EVERY_STEPS) if abs(lag - first.lag) > EVERY_STEPS
    ]
    return max(
        [first, *(_climb(steps, one, learnt, judged) for one in others)], key=lambda rule: float(rule.told.max())
    )


def _simplest(rules: Sequence[_Rule]) -> list[_Rule]:
    """Those that tell most with fewest dimensions first."""
    best = max(float(rule.told.max()) for rule in rules)
    return sorted(rules, key=lambda rule: PARSIMONY * len(rule.dimensions) - float(rule.told.max()) / max(best, 1e-9))


def _candidates(steps: _Steps, learnt: Array, judged: Array, most: int) -> list[_Rule]:
    """Few dimensions each, and the delay at which they tell most, along the axis of a linear regression."""
    given, lags = _some(learnt[steps.given[learnt]], LEARNT_STEPS), np.arange(0, most + 1, 5)
    best: dict[tuple[int, ...], _Rule] = {}
    for lag in range(0, most + 1, EVERY_STEPS):
        for dimensions, weights in supports(steps.states[given - lag], steps.said[given]):
            part = ranked_parts(steps.states[:, dimensions] @ weights)
            told = np.array([information_of(part[judged - each], steps.kinds[judged]) for each in lags])
            rule, key = _Rule(dimensions, int(lags[told.argmax()]), np.repeat(told, 5)[: most + 1]), tuple(dimensions)
            best[key] = max(best.get(key, rule), rule, key=lambda one: float(one.told.max()))
    return _simplest([*best.values()])[:TRIED]


def _climb(steps: _Steps, rule: _Rule, learnt: Array, judged: Array) -> _Rule:
    """The delay at which these dimensions tell most, from the axis at one delay to the next better one."""
    best, lag = rule._replace(told=np.zeros_like(rule.told)), rule.lag
    for _ in range(CLIMBS):
        part = _parts(steps, rule.dimensions, lag, learnt)
        told = np.array([information_of(part[judged - each], steps.kinds[judged]) for each in range(len(rule.told))])
        best = max(best, rule._replace(lag=int(told.argmax()), told=told), key=lambda one: float(one.told.max()))
        if int(told.argmax()) == lag:
            break
        lag = int(told.argmax())
    return best


def _parts(steps: _Steps, dimensions: list[int], lag: int, learnt: Array) -> Array:
    """The part ``(N,)`` of the state at each step, learnt from rows ``learnt`` and the states ``lag`` steps before."""
    states = steps.states[:, dimensions]
    given, every = _some(learnt[steps.given[learnt]], LEARNT_STEPS), _some(learnt, LEARNT_STEPS)
    places = states @ axes_of(states[given - lag], steps.kinds[given])
    return part_of(partition(places[every - lag], steps.kinds[every]), places)


def _gained(steps: _Steps, dimensions: list[int], lag: int, top: int) -> Array:
    """Information ``(E, D)`` in each episode at delays from ``-BEFORE_STEPS`` to ``top``; the rule is of the others."""
    rows, lags = steps.rows(top), range(-BEFORE_STEPS, top + 1)
    found = np.zeros((int(steps.episode[-1]) + 1, len(lags)))
    for fold in (0, 1):
        own = steps.episode[rows] % 2 == fold
        part, judged = _parts(steps, dimensions, lag, rows[~own]), rows[own]
        for column, each in enumerate(lags):
            gain = gains(part[steps.before(judged, each)], steps.kinds[judged])
            found[:, column] += np.bincount(steps.episode[judged], gain, len(found))
    return found


def _answer(gained: Array, most: int, rows: int) -> Delay:
    """The delay with most information, with an interval over resampled episodes and over halves of them."""
    weights = np.random.default_rng(0).multinomial(len(gained), np.full(len(gained), 1 / len(gained)), BOOTSTRAPS)
    total = gained.sum(axis=0)
    best = int(total.argmax()) - BEFORE_STEPS
    halves = [int(gained[fold::2].sum(axis=0).argmax()) - BEFORE_STEPS for fold in (0, 1)]
    low, high = np.percentile((weights @ gained).argmax(axis=1) - BEFORE_STEPS, LOW_HIGH)
    low, high = int(min(low, *halves)), int(max(high, *halves))
    untold = high - low > WIDEST_STEPS or best < -EARLY_STEPS or high >= most
    if untold or total.max() < MIN_INFORMATION * rows:
        return Delay(0, 0, most, known=False)
    none = low <= 0 or best < LEAST_STEPS
    return Delay(0, 0, max(0, high)) if none else Delay(best, low, high)


def caught_up(episodes: Sequence[Episode], delay: Delay | None) -> list[Episode]:
    """The same episodes with what was said at the steps that it was about; nothing at the last ones."""
    if delay is None or not delay.steps:
        return [*episodes]
    return [
        replace(one, instructions=_earlier(one.instructions, delay.steps), given=_earlier(one.given, delay.steps))
        for one in episodes
    ]


def _earlier(column: Array, steps: int) -> Array:
    """The rows ``(T, ...)`` so many steps earlier; zeros where there are none."""
    moved = np.zeros_like(column)
    moved[: max(0, len(column) - steps)] = column[steps:]
    return moved
