"""What the words of an instructor are known to mean, and on what evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from ibe_rl.types import Array, read_only


class UnknownMeaningWarning(UserWarning):
    """The log does not show what an instruction asks for."""


@dataclass(frozen=True)
class Evidence:
    """What one source says about one number of the instruction.

    Attributes:
        source: "best": how the best episodes moved under the instruction (the paper's); "satisfaction": after which
            movement the instructor stops asking for it; "influence": how the agent's behaviour depends on the
            instruction in the same state; "pays": whether episodes with more of the movement earn more;
            "pays_at_once": whether windows with more of it than expected earn more.
        effect: above 0 if the axis points the way that +1 asks for. In standard deviations of the movement; for
            "pays" and "pays_at_once" a correlation.
        low: lower end of the 99 % confidence interval.
        high: upper end.
        episodes: how many it stands on.
    """

    source: str
    effect: float
    low: float
    high: float
    episodes: int

    @property
    def sign(self) -> int:
        """The sign of the effect, 0 if the interval contains 0."""
        return int(self.low > 0) - int(self.high < 0)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """From JSON; raises ValueError, KeyError or TypeError if a value is missing or not finite."""
        effect, low, high = (float(values[name]) for name in ("effect", "low", "high"))
        if not np.isfinite([effect, low, high]).all():
            raise ValueError("not all of its numbers are finite")
        return cls(str(values["source"]), effect, low, high, int(values["episodes"]))


@dataclass(frozen=True)
class Meaning:
    """What is known of the words for one number of the instruction.

    Attributes:
        negative: whether it is known which movement the instructions below 0 ask for.
        positive: the same of those above 0.
        reason: one line: which sources it stands on, or why the meaning is unknown.
        evidence: of each source that could be evaluated.
        episodes: how many were read.
        direction: ``S`` numbers: how far +1 asks each state dimension to rise, in standard deviations of its movement,
            scaled to a maximum magnitude of 1. Empty where no axis was found. While the sign is unknown, the way the
            best episodes moved.
        moves: of a word, ``S`` numbers: the mean change of the state after it, in observation units. ``positive`` is
            then whether the word is known. Empty for numbers.
        same_as: of a word, the slot of another one that is used alike and is spoken for both; None if there is none.
    """

    negative: bool = True
    positive: bool = True
    reason: str = ""
    evidence: tuple[Evidence, ...] = ()
    episodes: int = 0
    direction: tuple[float, ...] = ()
    moves: tuple[float, ...] = ()
    same_as: int | None = None

    @classmethod
    def unknown(cls, reason: str, episodes: int) -> Self:
        """The meaning of a number of which neither sign is known."""
        return cls(negative=False, positive=False, reason=reason, episodes=episodes)

    @property
    def known(self) -> bool:
        """Whether the meaning of either sign is known; of a word, whether its meaning is."""
        return self.positive if self.moves else self.negative or self.positive

    def as_the_best_did(self) -> Meaning:
        """The meaning where clusters are named by the mean instruction of the best episodes, as in the paper.

        Such names are only known if these episodes followed the instruction.
        """
        best = self.effect_of("best")
        if not self.known or (best is not None and best.effect > 0):
            return self
        reason = "the best episodes did the opposite" if best else "too few of the best episodes have instructions"
        return replace(self, negative=False, positive=False, reason=reason)

    def turned(self) -> Meaning:
        """The same, seen along the opposite axis."""
        other = [replace(one, effect=-one.effect, low=-one.high, high=-one.low) for one in self.evidence]
        return replace(self, evidence=tuple(other), direction=tuple(-each for each in self.direction))

    def effect_of(self, source: str) -> Evidence | None:
        """The evidence of a source; None if it could not be evaluated."""
        return next((one for one in self.evidence if one.source == source), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        plain = asdict(self) | {"evidence": [asdict(each) for each in self.evidence]}
        of_words = () if self.moves else ("moves", "same_as")
        return {name: value for name, value in plain.items() if name not in of_words}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``; raises ValueError if a value is missing or not finite."""
        try:
            evidence = tuple(Evidence.from_dict(each) for each in values["evidence"])
            direction = tuple(float(each) for each in values["direction"])
            moves = tuple(float(each) for each in values.get("moves", ()))
            if not np.isfinite([*direction, *moves]).all():
                raise ValueError("not all of its numbers are finite")
            return cls(
                negative=bool(values["negative"]),
                positive=bool(values["positive"]),
                reason=str(values["reason"]),
                evidence=evidence,
                episodes=int(values["episodes"]),
                direction=direction,
                moves=moves,
                same_as=None if values.get("same_as") is None else int(values["same_as"]),
            )
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"the meaning is damaged: {error}") from None


def sayable(expressions: Array, meanings: Sequence[Meaning]) -> Array:
    """Which expressions ``(W, d)`` are words whose meaning is known: ``(W,)`` bool; without ``meanings`` all are.

    The expression 0 is known as soon as either sign is. Of words, the one with the largest share has to be known.
    """
    if not meanings:
        return np.ones(len(expressions), bool)
    if meanings[0].moves:
        of_words: Array = np.array([one.positive for one in meanings])[np.argmax(expressions, axis=1)]
        return of_words
    negative, positive, any_known = (
        np.array([getattr(one, name) for one in meanings]) for name in ("negative", "positive", "known")
    )
    can: Array = np.where(expressions > 0, positive, np.where(expressions < 0, negative, any_known))
    return can.min(axis=1)


@dataclass(frozen=True)
class Interpretation:
    """What the words of an instructor are about.

    Attributes:
        axes: ``(S, d)`` in 1 / observation units; where the meaning is known, +1 asks for a movement along the axis.
        meanings: what is known of each number.
    """

    axes: Array
    meanings: tuple[Meaning, ...]


@dataclass(frozen=True)
class Reactions:
    """How the agent reacts to different instructions in the same state.

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
        """The inverse of ``to_dict``; raises ValueError if a value is missing or a shape does not fit."""
        try:
            return cls(np.asarray(values["up"], float), np.asarray(values["down"], float))
        except (KeyError, TypeError, OverflowError) as error:
            raise ValueError(f"the reactions are damaged: {error}") from None
