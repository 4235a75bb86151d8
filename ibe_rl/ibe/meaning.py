"""What the words of an instructor are known to mean, and on what evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from ibe_rl.types import Array


class UnknownMeaningWarning(UserWarning):
    """What an instruction asks for cannot be told from the log."""


@dataclass(frozen=True)
class Evidence:
    """What one source says about one number of the instruction.

    Attributes:
        source: "best": how the best episodes moved under the instruction (the paper's); "satisfaction": after which
            movement the instructor stops asking for it; "influence": what the agent does if it is told otherwise in
            the same state; "pays": whether episodes earn more in which the movement was larger; "pays_at_once": whether
            moments do in which it was larger than usual there.
        effect: how far +1 is followed along the instructor's axis, in standard deviations of the movement (for "pays"
            and "pays_at_once" a correlation); above 0 the axis points the way that +1 asks for.
            a rank correlation); above 0 the axis points the way that +1 asks for.
        low: lower end of its 99 % interval.
        high: upper end.
        episodes: that it stands on.
    """

    source: str
    effect: float
    low: float
    high: float
    episodes: int

    @property
    def sign(self) -> int:
        """The direction that the evidence is clear about, 0 if it is not."""
        return int(self.low > 0) - int(self.high < 0)


@dataclass(frozen=True)
class Meaning:
    """What is known of the words for one number of the instruction.

    Attributes:
        negative: whether it is known which movement the instructions below 0 ask for.
        positive: the same of those above 0.
        reason: one line in plain words: on what it stands, or why it cannot be told.
        evidence: of each source that could be asked.
        episodes: that were looked at.
        direction: ``S`` numbers, for each state dimension how far +1 asks it to rise, in standard deviations of its
            movement, the largest being 1 or -1; empty where no axis was found. As the best episodes moved, if it is not
            known.
    """

    negative: bool = True
    positive: bool = True
    reason: str = ""
    evidence: tuple[Evidence, ...] = ()
    episodes: int = 0
    direction: tuple[float, ...] = ()

    @classmethod
    def unknown(cls, reason: str, episodes: int, evidence: tuple[Evidence, ...] = ()) -> Self:
        """Of a number none of whose words is known."""
        return cls(negative=False, positive=False, reason=reason, evidence=evidence, episodes=episodes)

    @property
    def known(self) -> bool:
        """Whether any of its words is known."""
        return self.negative or self.positive

    def as_the_best_did(self) -> Meaning:
        """What is known of words that are called by what the best episodes were told, as the paper's.

        They are known only if these episodes moved the way that is meant.
        """
        best = self.effect_of("best")
        if not self.known or (best is not None and best.effect > 0):
            return self
        reason = "the best episodes did the opposite" if best else "too few of the best episodes were told anything"
        return replace(self, negative=False, positive=False, reason=reason)

    def turned(self) -> Meaning:
        """The same along the opposite of the axis."""
        other = [replace(one, effect=-one.effect, low=-one.high, high=-one.low) for one in self.evidence]
        return replace(self, evidence=tuple(other), direction=tuple(-each for each in self.direction))

    def effect_of(self, source: str) -> Evidence | None:
        """What a source says; None if it could not be asked."""
        return next((one for one in self.evidence if one.source == source), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self) | {"evidence": [asdict(each) for each in self.evidence]}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``.

        Raises:
            ValueError: if a value is missing or is none.
        """
        try:
            evidence = tuple(_evidence(each) for each in values["evidence"])
            sides = bool(values["negative"]), bool(values["positive"])
            direction = tuple(float(each) for each in values["direction"])
            if not np.isfinite(direction).all():
                raise ValueError("not all of its numbers are finite")
            return cls(*sides, str(values["reason"]), evidence, int(values["episodes"]), direction)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"the meaning is damaged: {error}") from None


def _evidence(values: dict[str, Any]) -> Evidence:
    effect, low, high = (float(values[name]) for name in ("effect", "low", "high"))
    if not np.isfinite([effect, low, high]).all():
        raise ValueError("not all of its numbers are finite")
    return Evidence(str(values["source"]), effect, low, high, int(values["episodes"]))


def sayable(expressions: Array, meanings: Sequence[Meaning]) -> Array:
    """Which expressions ``(W, d)`` are words whose meaning is known: ``(W,)`` bool; without ``meanings`` all are.

    No movement can be said as soon as one of the two ways is known.
    """
    if not meanings:
        return np.ones(len(expressions), bool)
    negative, positive, any_known = (
        np.array([getattr(one, name) for one in meanings]) for name in ("negative", "positive", "known")
    )
    can: Array = np.where(expressions > 0, positive, np.where(expressions < 0, negative, any_known))
    return can.min(axis=1)
