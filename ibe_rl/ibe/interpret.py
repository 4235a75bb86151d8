"""Infer the axis and the sign that an instructor means from several sources of evidence, or that they are unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.ibe.delta import LoggedSteps, top_episodes
from ibe_rl.ibe.evidence import (
    MIN_EPISODES,
    compliance,
    influence,
    influence_of_plan,
    pays,
    pays_at_once,
    satisfaction,
)
from ibe_rl.ibe.meaning import Evidence, Interpretation, Meaning, Reactions
from ibe_rl.ibe.rates import depends_on_state, integral, is_rate
from ibe_rl.ibe.space import TooLittleDataError, lasso_axes, rule_axes
from ibe_rl.types import Array, Episode

MIN_EFFECT = 0.1
"""Smaller effects do not count, however many episodes they stand on."""
MIN_TOLD_STEPS = 20
"""Steps with an instruction of a sign, for the meaning of that sign to be known."""
AXIS_STEPS = 5_000
"""Most steps that an axis is fitted on."""


def interpret(
    episodes: Sequence[Episode],
    horizon_steps: int,
    *,
    top_fraction: float = 0.25,
    reactions: Reactions | None = None,
    dimensions: Sequence[int] | None = None,
    seed: int = 0,
) -> Interpretation:
    """Infer what each number of an instruction asks for.

    Args:
        episodes: a fair sample of good and bad ones.
        horizon_steps: n, the length of a movement.
        top_fraction: x, share of the episodes that count as the best.
        reactions: of an agent that reads the instruction; None if it does not, or was not tested.
        dimensions: indices of the state dimensions that count; None takes all.
        seed: of samples and resampling.

    Returns:
        For each number an axis and its ``Meaning``; the axis is 0 where none was found.

    Raises:
        ValueError: without any episode.
    """
    log = LoggedSteps.of(episodes, horizon_steps)
    size = log.states.shape[1]
    kept = np.isin(np.arange(size), range(size) if dimensions is None else dimensions)
    reader = _Reader(log, top_episodes(log.returns, top_fraction), reactions, kept, seed)
    axes, meanings = zip(*(reader.read(number) for number in range(log.instruction.shape[1])), strict=True)
    return Interpretation(np.stack(axes, axis=1), meanings)


@dataclass(frozen=True)
class _Candidate:
    """An axis that a number may be about, its evidence and sign, and how far all episodes complied with it."""

    axis: Array
    evidence: tuple[Evidence, ...]
    sign: int
    reason: str
    followed: float


@dataclass(frozen=True)
class _Reader:
    """Reads the numbers of an instruction one by one; ``top`` ``(E,)`` and ``kept`` ``(S,)`` are bool."""

    log: LoggedSteps
    top: Array
    reactions: Reactions | None
    kept: Array
    seed: int

    def read(self, number: int) -> tuple[Array, Meaning]:
        """The axis ``(S,)`` of one number, and what is known of it."""
        log, signs = self.log, self.log.signs(number)
        said = np.unique(log.instruction[log.given, number])
        if len(said) < 2:
            only = f"has only ever said {said[0]:g}" if len(said) else "never said anything"
            return np.zeros(len(self.kept)), Meaning.unknown(f"the instructor {only}", log.episode_count)
        chosen = self._chosen(number)
        if not np.any(chosen.axis):
            return chosen.axis, Meaning.unknown("no movement goes with the instruction", log.episode_count)
        negative, positive = (bool(chosen.sign) and int((signs == sign).sum()) >= MIN_TOLD_STEPS for sign in (-1, 1))
        rises = chosen.axis * log.delta.std(axis=0)
        direction = tuple((rises / (np.abs(rises).max() or 1.0)).tolist())
        enough = log.episode_count >= MIN_EPISODES
        reason = chosen.reason if enough else f"{log.episode_count} episodes are too few"
        meaning = Meaning(negative, positive, reason, chosen.evidence, log.episode_count, direction)
        return (-chosen.axis, meaning.turned()) if chosen.sign < 0 else (chosen.axis, meaning)

    def _chosen(self, number: int) -> _Candidate:
        """If the axis is a rate of change, its integral is tried too: the one that is complied with is meant."""
        depends = depends_on_state(self.log, number, self.seed)
        axis = (self._axis_of_rule(number) if depends else self._axis_of_plan(number)) * self.kept
        rate = depends and is_rate(self.log, axis, self.seed)
        tried = [self._candidate(axis, number, depends, depends and not rate)]
        if rate:
            tried.append(self._candidate(integral(self.log, axis) * self.kept, number, depends, False))
        return next((one for one in tried if one.sign * one.followed > 0), tried[0])

    def _axis_of_rule(self, number: int) -> Array:
        """Along which the instruction changes with the state; +1 ends further along it."""
        log, rows = self.log, self._sample(self.log.given)
        moving = np.ptp(log.delta, axis=0) > 0
        axis: Array = -rule_axes(log.states[rows], log.instruction[rows][:, [number]], self.seed, moving)[:, 0]
        return axis

    def _axis_of_plan(self, number: int) -> Array:
        """Along which the movement depends on the instruction, in even episodes: the odd ones are evidence later."""
        log, rows = self.log, self._sample(self.log.given & (self.log.episode % 2 == 0))
        try:
            axis: Array = lasso_axes(log.delta[rows], log.instruction[rows][:, [number]], self.seed)[:, 0]
        except TooLittleDataError:
            axis = np.zeros(len(self.kept))
        return axis

    def _sample(self, among: Array) -> Array:
        return np.random.default_rng(self.seed).permutation(np.flatnonzero(among))[:AXIS_STEPS]

    def _candidate(self, axis: Array, number: int, depends: bool, is_place: bool) -> _Candidate:
        log, seed = self.log, self.seed
        found = (
            compliance(log, axis, number, self.top, seed),
            satisfaction(log, axis, number, seed) if is_place else None,
            self._influence(axis, number, depends),
            pays(log, axis, number, seed),
            pays_at_once(log, axis, number, seed),
        )
        evidence = tuple(one for one in found if one)
        sign, reason = decide(evidence, depends)
        everywhere = compliance(log, axis, number, np.ones_like(self.top), seed)
        return _Candidate(axis, evidence, sign, reason, everywhere.effect if everywhere else 0.0)

    def _influence(self, axis: Array, number: int, depends: bool) -> Evidence | None:
        if self.reactions is not None:
            up, down = self.reactions.up[:, number], self.reactions.down[:, number]
            return influence(self.log, axis, up, down, self.seed)
        return None if depends else influence_of_plan(self.log, axis, number, self.seed)


def decide(evidence: Sequence[Evidence], depends: bool) -> tuple[int, str]:
    """Combine the sources by a vote; ``depends`` tells whether the instruction depends on the state.

    Returns:
        1 if +1 asks for a movement along the axis, -1 if for the opposite, 0 if that is unknown; and why.
    """
    says = {one.source: one.sign for one in evidence if abs(one.effect) >= MIN_EFFECT}
    effect = {one.source: one.effect for one in evidence}
    stops, listens = (says.get(source, 0) for source in ("satisfaction", "influence"))
    earns = says.get("pays_at_once" if "pays_at_once" in effect else "pays", 0)  # else all windows earn the same
    if earns == -stops and says.get("best", 0) != earns:
        earns = 0  # the best episodes did comply: another behaviour pays more in the short run
    votes = {"satisfaction": stops, "influence": listens, "pays": earns}
    for sign in (1, -1):
        on, against = [[name for name, vote in votes.items() if vote == way] for way in (sign, -sign)]
        if _is_enough(on, against, depends):
            return sign, "from " + " and ".join(_FROM[name] for name in on)
    return 0, _why_not(stops, listens, earns, effect)


def _is_enough(on: Sequence[str], against: Sequence[str], depends: bool) -> bool:
    """Whether the sources for a sign are enough against the others.

    Satisfaction is, unless it is outvoted. Influence and reward are only enough together: an agent may do the opposite,
    or be rewarded for it. Where the instruction does not depend on the state no movement ends it, and the agent is
    taken to obey.
    """
    if "satisfaction" in on:
        return len(on) > len(against)
    if against:
        return False
    return len(on) == 2 or (on == ["influence"] and not depends)


_FROM = {
    "satisfaction": "what ends the instruction",
    "influence": "how the agent reacts to the instruction",
    "pays": "what is rewarded",
}


def _why_not(stops: int, listens: int, earns: int, effect: dict[str, float]) -> str:
    if stops and earns == -stops:
        return "the reward favours the opposite of what ends the instruction"
    if stops and listens == -stops:
        return "the agent does the opposite of what ends the instruction"
    if listens and earns:
        return "the agent's reaction to the instruction is not what is rewarded"
    if listens or earns:
        return f"the only evidence is {_FROM['influence' if listens else 'pays']}"
    if effect.get("influence") == 0:
        return "the agent did the same under every instruction, and whether following is rewarded is unclear"
    return "neither the end of instructions, nor the agent's reaction, nor the reward shows it"
