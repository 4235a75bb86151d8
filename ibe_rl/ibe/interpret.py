"""Along which axes, and which way, the words of an instructor are meant: found from several sources, or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ibe_rl.ibe.delta import top_episodes
from ibe_rl.ibe.evidence import FEWEST_EPISODES, best, influence, influence_of_plan, pays, pays_at_once, satisfaction
from ibe_rl.ibe.meaning import Evidence, Meaning
from ibe_rl.ibe.rates import depends_on_state, integral, is_rate
from ibe_rl.ibe.record import Record
from ibe_rl.ibe.space import TooLittleDataError, lasso_axes, rule_axes
from ibe_rl.types import Array, Episode, read_only

CLEAR = 0.1
"""Effects below this are none, however many episodes they stand on."""
FEWEST_SAID = 20
"""Steps at which an instruction has to be heard, for its word to be known."""
HEARD_STATES = 5_000
"""In which an axis is looked for."""


@dataclass(frozen=True)
class Reactions:
    """What the agent does if it is told otherwise in the same state.

    Attributes:
        up: ``(M, d, S)`` changes of the state over the horizon, from ``M`` states of different episodes, when each
            number of the instruction is +1 and the others are 0.
        down: ``(M, d, S)`` the same with -1.
    """

    up: Array
    down: Array

    def __post_init__(self) -> None:
        for name in ("up", "down"):
            object.__setattr__(self, name, read_only(np.asarray(getattr(self, name), float), (None,) * 3, name))
        if self.up.shape != self.down.shape or not (np.isfinite(self.up).all() and np.isfinite(self.down).all()):
            raise ValueError(f"reactions of shapes {self.up.shape} and {self.down.shape}: not alike and finite")

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        return {"up": self.up.tolist(), "down": self.down.tolist()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``.

        Raises:
            ValueError: if a value is missing or shapes do not fit.
        """
        try:
            return cls(np.asarray(values["up"], float), np.asarray(values["down"], float))
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f"the reactions are damaged: {error}") from None


@dataclass(frozen=True)
class Interpretation:
    """What the words of an instructor are about.

    Attributes:
        axes: ``(S, d)`` in 1 / observation units; where the meaning is known, +1 asks for a movement along the axis.
        meanings: what is known of each number.
    """

    axes: Array
    meanings: tuple[Meaning, ...]


def interpret(
    episodes: Sequence[Episode],
    horizon_steps: int,
    *,
    top_fraction: float = 0.25,
    reactions: Reactions | None = None,
    dimensions: Sequence[int] | None = None,
    seed: int = 0,
) -> Interpretation:
    """Find out what each number of an instruction asks for, or that it cannot be told.

    A number that no axis can be found for has one of zeros.

    Args:
        episodes: good and bad ones, a fair sample.
        horizon_steps: n, over which movements are looked at.
        top_fraction: x, share of the episodes that count as the best.
        reactions: of an agent that is told; None: it is not, or nobody has asked it.
        dimensions: indices of the state dimensions that count; None takes all.
        seed: of samples and resampling.

    Raises:
        ValueError: without any episode.
    """
    log = _Log(Record.of(episodes, horizon_steps), top_fraction, reactions, dimensions, seed)
    found = [log.number(number) for number in range(log.record.told.shape[1])]
    return Interpretation(np.stack([axis for axis, _ in found], axis=1), tuple(meaning for _, meaning in found))


@dataclass(frozen=True)
class _Candidate:
    """An axis that a number may be about, what the sources say of it, and which way it is followed."""

    axis: Array
    evidence: tuple[Evidence, ...]
    sign: int
    reason: str
    followed: float


class _Log:
    """What all numbers of an instruction are read from."""

    def __init__(
        self,
        record: Record,
        top_fraction: float,
        reactions: Reactions | None,
        dimensions: Sequence[int] | None,
        seed: int,
    ):
        self.record, self._reactions, self._seed = record, reactions, seed
        self._top = top_episodes(record.returns, top_fraction)
        size = record.states.shape[1]
        self._kept = np.isin(np.arange(size), range(size) if dimensions is None else dimensions)

    def number(self, number: int) -> tuple[Array, Meaning]:
        """The axis ``(S,)`` of one number, and what is known of it."""
        record, signs = self.record, self.record.signs(number)
        said = np.unique(record.told[record.given, number])
        if len(said) < 2:
            only = (
                f"the instructor has only ever said {said[0]:g}" if len(said) else "the instructor never said anything"
            )
            return np.zeros(len(self._kept)), Meaning.unknown(only, record.size)
        chosen = self._chosen(number)
        if not np.any(chosen.axis):
            return chosen.axis, Meaning.unknown("nothing that moves goes with what is said", record.size)
        sides = [bool(chosen.sign) and int((signs == side).sum()) >= FEWEST_SAID for side in (-1, 1)]
        rises = chosen.axis * record.delta.std(axis=0)
        direction = tuple((rises / (np.abs(rises).max() or 1.0)).tolist())
        reason = chosen.reason if record.size >= FEWEST_EPISODES else f"{record.size} episodes are too few to tell"
        meaning = Meaning(sides[0], sides[1], reason, chosen.evidence, record.size, direction)
        return (-chosen.axis, meaning.turned()) if chosen.sign < 0 else (chosen.axis, meaning)

    def _chosen(self, number: int) -> _Candidate:
        """Of a rate and of what it is the rate of, that which is followed; else the axis of the rule or the plan."""
        depends = depends_on_state(self.record, number, self._seed)
        axis = self._axis_of_rule(number) if depends else self._axis_of_plan(number)
        rate = depends and is_rate(self.record, axis, self._seed)
        tried = [self._candidate(axis, number, depends, depends and not rate)]
        if rate:
            tried.append(self._candidate(integral(self.record, axis) * self._kept, number, depends, False))
        return next((one for one in tried if one.sign * one.followed > 0), tried[0])

    def _axis_of_rule(self, number: int) -> Array:
        """The one on which the words turn, the way that makes +1 end."""
        record = self.record
        rows = np.random.default_rng(self._seed).permutation(np.flatnonzero(record.given))[:HEARD_STATES]
        moving = np.ptp(record.delta, axis=0) > 0
        axis: Array = rule_axes(record.states[rows], record.told[rows][:, [number]], self._seed, moving)[:, 0]
        return -axis * self._kept

    def _axis_of_plan(self, number: int) -> Array:
        """The one along which it shows what was said, from every other episode."""
        record = self.record
        rows = np.random.default_rng(self._seed).permutation(np.flatnonzero(record.given & (record.episode % 2 == 0)))
        rows = rows[:HEARD_STATES]
        try:
            axis: Array = lasso_axes(record.delta[rows], record.told[rows][:, [number]], self._seed)[:, 0]
        except TooLittleDataError:
            axis = np.zeros(len(self._kept))
        return axis * self._kept

    def _candidate(self, axis: Array, number: int, depends: bool, is_place: bool) -> _Candidate:
        record, seed = self.record, self._seed
        found = (
            best(record, axis, number, self._top, seed),
            satisfaction(record, axis, number, seed) if is_place else None,
            self._influence(axis, number, depends),
            pays(record, axis, number, seed),
            pays_at_once(record, axis, number, seed),
        )
        evidence = tuple(one for one in found if one)
        sign, reason = decide(evidence, depends)
        everywhere = best(record, axis, number, np.ones_like(self._top), seed)
        return _Candidate(axis, evidence, sign, reason, everywhere.effect if everywhere else 0.0)

    def _influence(self, axis: Array, number: int, depends: bool) -> Evidence | None:
        if self._reactions is not None:
            up, down = self._reactions.up[:, number], self._reactions.down[:, number]
            return influence(self.record, axis, up, down, self._seed)
        return None if depends else influence_of_plan(self.record, axis, number, self._seed)


def decide(evidence: Sequence[Evidence], depends: bool) -> tuple[int, str]:
    """Put the sources together.

    Args:
        evidence: of the sources that could be asked.
        depends: whether what is said depends on the state.

    Returns:
        1 if +1 asks for a movement along the axis, -1 if for the opposite, 0 if it cannot be told; and why.
    """
    says = {one.source: one.sign for one in evidence if abs(one.effect) >= CLEAR}
    effect = {one.source: one.effect for one in evidence}
    at_once = "pays_at_once" in effect  # else all windows earn the same
    stops, listens = (says.get(source, 0) for source in ("satisfaction", "influence"))
    earns = says.get("pays_at_once" if at_once else "pays", 0)
    if earns == -stops and says.get("best", 0) != earns:
        earns = 0  # those who earned most did do it; something else pays better at once
    votes = {"satisfaction": stops, "influence": listens, "pays": earns}
    for sign in (1, -1):
        on, against = [[name for name, vote in votes.items() if vote == way] for way in (sign, -sign)]
        if _carries(on, against, depends):
            return sign, "from " + " and ".join(_FROM[name] for name in on)
    return 0, _why_not(stops, listens, earns, effect)


def _carries(on: Sequence[str], against: Sequence[str], depends: bool) -> bool:
    """Whether the sources that say so are enough.

    What ends an instruction is, unless it is contradicted alone. What the agent does, and what pays, are only
    together: an agent may do the opposite, or be paid for it. Where what is said does not depend on the state, nothing
    can end it, and the agent's answer is taken for obedience.
    """
    if "satisfaction" in on:
        return len(on) > len(against)
    if against:
        return False
    return len(on) == 2 or (on == ["influence"] and not depends)


_FROM = {
    "satisfaction": "what ends it",
    "influence": "what the agent does when told otherwise",
    "pays": "what pays",
}


def _why_not(stops: int, listens: int, earns: int, effect: dict[str, float]) -> str:
    if stops and earns == -stops:
        return "those who earned most did not do it"
    if stops and listens == -stops:
        return "the agent does the opposite of what would end it"
    if listens and earns:
        return "what the agent does when told is not what pays"
    if listens or earns:
        return f"it shows only in {_FROM['influence' if listens else 'pays']}"
    if effect.get("influence") == 0:
        return "the agent did the same whatever it was told, and whether following pays is not clear"
    return "neither what ends it, nor the agent, nor what pays shows it"
