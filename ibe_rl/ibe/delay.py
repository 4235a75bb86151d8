"""How late an instructor is, from the log alone: at which delay the state explains best what was said.

A rule reads few dimensions of the state. Late instructions also look like a rule of today's place and velocity, as the
two give the place of a while ago. So a delay is believed with the fewest dimensions that explain what was said. How
well they do is the mutual information of what was said and a partition of the state: mistakes and silence lower it at
every delay alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ibe_rl.ibe.rule_parts import axes_of, gains, information, levels_of, part_of, partition, ranked_parts, supports
from ibe_rl.types import Array, Episode

MOST_DELAY_STEPS = 100
SHARE_OF_EPISODE = 0.5
"""Longer delays than this share of the median episode are not looked for."""
EVERY_STEPS, BEFORE_STEPS, BEYOND_STEPS = 15, 20, 25
"""Steps between the delays at which rules are looked for; how far before 0 and beyond the best one is compared."""
PARSIMONY = 0.02
"""Share of the information that one more dimension of the state must add to be believed."""
MIN_INFORMATION, MIN_CHANGES = 0.02, 10
"""Nats a step that the state must tell of what was said, and changes of the instruction: with less nothing is said."""
WIDEST_STEPS = 20
"""A wider interval is no answer."""
RESAMPLES, INTERVAL_PERCENTILES = 200, (5, 95)
MOST_EPISODES, LEARNT_STEPS, JUDGED_STEPS = 300, 3_000, 5_000
TRIED, CLIMBS = 4, 3


@dataclass(frozen=True)
class Delay:
    """How late an instructor is, in steps of the environment.

    Attributes:
        steps: behind what it instructs about; 0 where that cannot be told.
        low: end of the 90 % interval over episodes; 0 where it cannot be told.
        high: likewise the other end; the longest delay looked for where it cannot be told.
        known: False if the log does not tell.
    """

    steps: int
    low: int
    high: int
    known: bool = True


class _Steps(NamedTuple):
    """Joined steps of episodes: standardised states ``(N, S)``, what was said as classes, and where.

    ``first`` ``(N,)`` is the step of the first instruction of the episode, ``last`` ``(N,)`` the row of its last step.
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
    """Dimensions that a number of the instruction reads, how late it is then, and how much they tell of it."""

    dimensions: list[int]
    lag: int
    information: Array


def find_delay(episodes: Sequence[Episode]) -> Delay:
    """Find how late the instructor of these episodes is; good and bad ones, of one instructor."""
    episodes = [one for one in episodes if np.any(one.given)][-MOST_EPISODES:]
    most = min([MOST_DELAY_STEPS, *(int(SHARE_OF_EPISODE * np.median([len(one) for one in episodes])) for _ in "1" if episodes)])
    numbers = [_joined(episodes, number) for number in range(episodes[0].instructions.shape[1])] if episodes else []
    numbers = [one for one in numbers if _changes(one) >= MIN_CHANGES and len(one.rows(most)) >= 10 * MIN_CHANGES]
    if most < 2 or not numbers:
        return Delay(0, 0, most, known=False)
    rules = [_find_rule(one, most) for one in numbers]
    lag = int(np.sum([rule.information for rule in rules], axis=0).argmax())
    top, best = min(most, lag + BEYOND_STEPS), None
    for _ in range(CLIMBS):
        gained = sum(_gained(one, rule.dimensions, lag, top) for one, rule in zip(numbers, rules, strict=True))
        if best is None or gained.sum() > best.sum(axis=0).max():
            best = gained
        new = max(0, int(gained.sum(axis=0).argmax()) - BEFORE_STEPS)
        if new == lag:
            break
        lag = new
    return _answer(best, most, sum(len(one.rows(top)) for one in numbers))


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


def _changes(steps: _Steps) -> int:
    """Changes of what was said within episodes."""
    rows = steps.rows(1)
    both = steps.given[rows] & steps.given[rows - 1]
    return int(np.sum((steps.kinds[rows] != steps.kinds[rows - 1]) & (both | True)))


def _some(rows: Array, most: int) -> Array:
    return np.sort(np.random.default_rng(0).permutation(rows)[:most])


def _find_rule(steps: _Steps, most: int) -> _Rule:
    rows = steps.rows(most)
    learnt, judged = (rows[steps.episode[rows] % 2 == fold] for fold in (0, 1))
    judged = _some(judged, JUDGED_STEPS)
    tried = [_climb(steps, rule, learnt, judged, most) for rule in _candidates(steps, learnt, judged, most)]
    first = _simplest(tried)[0]
    again = [_climb(steps, first._replace(lag=lag), learnt, judged, most) for lag in range(0, most + 1, EVERY_STEPS)]
    return max([first, *again], key=lambda rule: rule.information.max())


def _simplest(rules: Sequence[_Rule]) -> list[_Rule]:
    """Those that tell most with fewest dimensions first."""
    best = max(float(rule.information.max()) for rule in rules)
    return sorted(rules, key=lambda rule: PARSIMONY * len(rule.dimensions) - rule.information.max() / best)


def _candidates(steps: _Steps, learnt: Array, judged: Array, most: int) -> list[_Rule]:
    """Few dimensions each, and the delay at which they tell most, along the axis of a linear regression."""
    given = _some(learnt[steps.given[learnt]], LEARNT_STEPS)
    best: dict[tuple[int, ...], _Rule] = {}
    for lag in range(0, most + 1, EVERY_STEPS):
        for dimensions, weights in supports(steps.states[given - lag], steps.said[given]):
            part = ranked_parts(steps.states[:, dimensions] @ weights)
            told = np.array([information(part[judged - each], steps.kinds[judged]) for each in range(0, most + 1, 5)])
            rule, key = _Rule(dimensions, 5 * int(told.argmax()), told), tuple(dimensions)
            best[key] = max(best.get(key, rule), rule, key=lambda one: one.information.max())
    return _simplest([*best.values()])[:TRIED]


def _climb(steps: _Steps, rule: _Rule, learnt: Array, judged: Array, most: int) -> _Rule:
    """The delay at which these dimensions tell most, from the axis at one delay to the next better one."""
    found, lag = None, rule.lag
    for _ in range(CLIMBS):
        part = _parts(steps, rule.dimensions, lag, learnt)
        told = np.array([information(part[judged - each], steps.kinds[judged]) for each in range(most + 1)])
        if found is None or told.max() > found.information.max():
            found = _Rule(rule.dimensions, int(told.argmax()), told)
        if int(told.argmax()) == lag:
            break
        lag = int(told.argmax())
    return found


def _parts(steps: _Steps, dimensions: list[int], lag: int, learnt: Array, rounds: int = 2) -> Array:
    """The part ``(N,)`` of the state at each step, learnt from rows ``learnt`` and the states ``lag`` steps before."""
    states = steps.states[:, dimensions]
    given, every = _some(learnt[steps.given[learnt]], LEARNT_STEPS), _some(learnt, LEARNT_STEPS)
    places = states @ axes_of(states[given - lag], steps.kinds[given], rounds)
    return part_of(partition(places[every - lag], steps.kinds[every]), places)


def _gained(steps: _Steps, dimensions: list[int], lag: int, top: int) -> Array:
    """Information ``(E, D)`` in each episode at delays from ``-BEFORE_STEPS`` to ``top``, with the rule of the others."""
    rows, lags = steps.rows(top), range(-BEFORE_STEPS, top + 1)
    found = np.zeros((int(steps.episode[-1]) + 1, len(lags)))
    for fold in (0, 1):
        own = steps.episode[rows] % 2 == fold
        part, judged = _parts(steps, dimensions, lag, rows[~own], rounds=3), rows[own]
        for column, each in enumerate(lags):
            gain = gains(part[steps.before(judged, each)], steps.kinds[judged])
            found[:, column] += np.bincount(steps.episode[judged], gain, len(found))
    return found


def _answer(gained: Array, most: int, rows: int) -> Delay:
    random = np.random.default_rng(0)
    weights = random.multinomial(len(gained), np.full(len(gained), 1 / len(gained)), RESAMPLES)
    total = gained.sum(axis=0)
    best = int(total.argmax()) - BEFORE_STEPS
    low, high = (round(x) for x in np.percentile((weights @ gained).argmax(axis=1) - BEFORE_STEPS, INTERVAL_PERCENTILES))
    if high - low > WIDEST_STEPS or best < -5 or high >= most or total.max() < MIN_INFORMATION * rows:
        return Delay(0, 0, most, known=False)
    return Delay(0 if low <= 0 else best, max(low, 0), max(high,0))
