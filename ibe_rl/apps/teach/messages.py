"""The messages that a page may send to the training process."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

MAX_BYTES = 512
"""Longer messages are refused."""
MAX_COUNT = 2**53
"""The largest number that a page can count to."""
LONGEST_TEXT = 200
SPEEDS = (0.05, 1_000.0)


class BadMessageError(ValueError):
    """A message that our page never sends."""


@dataclass(frozen=True)
class Press:
    """The person instructs ``value``, a number or a word, until released, in the episode that they see."""

    sequence: int
    episode: int
    value: float | str


@dataclass(frozen=True)
class Release:
    """The person stops instructing."""

    sequence: int
    episode: int


@dataclass(frozen=True)
class Pause:
    """Pause or continue."""

    on: bool


@dataclass(frozen=True)
class Speed:
    """Step at ``times`` real time; None is as fast as possible."""

    times: float | None


@dataclass(frozen=True)
class HandOver:
    """Let the environment's rule instruct in place of the person, or take over again."""

    on: bool


@dataclass(frozen=True)
class Sit:
    """A watching page asks to instruct; granted if no other page does."""


@dataclass(frozen=True)
class Wrong:
    """The person calls an explanation wrong: the one made at this step of this episode."""

    episode: int
    step: int


@dataclass(frozen=True)
class Name:
    """The person renames the word of a slot, or adds one in the first free slot."""

    slot: int
    word: str


@dataclass(frozen=True)
class Typed:
    """The person typed a text that is neither a word nor a phrase yet."""

    text: str


@dataclass(frozen=True)
class CountAs:
    """The person says of a typed text whose word it says; the first free slot: it is a word of its own."""

    text: str
    slot: int


Message = Press | Release | Pause | Speed | HandOver | Sit | Wrong | Name | Typed | CountAs


def parse(text: str | bytes) -> Message:
    """Parse a message; any input gives a message or ``BadMessageError``.

    Args:
        text: as it came from the network.

    Raises:
        BadMessageError: in one short line that says why.
    """
    if not isinstance(text, str) or len(text) > MAX_BYTES:
        raise BadMessageError(f"not a text of at most {MAX_BYTES} characters")
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        raise BadMessageError("not JSON") from None
    if not isinstance(fields, dict) or not isinstance(fields.get("kind"), str) or fields["kind"] not in KINDS:
        raise BadMessageError(f"no kind of message; allowed are {', '.join(KINDS)}")
    kind, readers = KINDS[fields.pop("kind")]
    if fields.keys() != readers.keys():
        raise BadMessageError(f"a {kind.__name__} has {', '.join(readers) or 'nothing'} in it")
    return kind(**{name: read(name, fields[name]) for name, read in readers.items()})


def _count(name: str, value: Any) -> int:
    if type(value) is not int or not 0 <= value <= MAX_COUNT:
        raise BadMessageError(f"{name} is not a count")
    return value


def _flag(name: str, value: Any) -> bool:
    if type(value) is not bool:
        raise BadMessageError(f"{name} is neither true nor false")
    return value


def _number(name: str, value: Any, low: float, high: float) -> float:
    if type(value) not in (int, float) or not low <= value <= high:  # refuses NaN too
        raise BadMessageError(f"{name} is not a number from {low:g} to {high:g}")
    return float(value)


def _text(name: str, value: Any) -> str:
    if type(value) is not str or len(value) > LONGEST_TEXT:
        raise BadMessageError(f"{name} is not a text of at most {LONGEST_TEXT} characters")
    return value


def _value(name: str, value: Any) -> float | str:
    return _text(name, value) if type(value) is str else _number(name, value, -1.0, 1.0)


def _times(name: str, value: Any) -> float | None:
    return None if value is None else _number(name, value, *SPEEDS)


KINDS: dict[str, tuple[Callable[..., Message], dict[str, Callable[[str, Any], Any]]]] = {
    "press": (Press, {"sequence": _count, "episode": _count, "value": _value}),
    "release": (Release, {"sequence": _count, "episode": _count}),
    "pause": (Pause, {"on": _flag}),
    "speed": (Speed, {"times": _times}),
    "oracle": (HandOver, {"on": _flag}),
    "sit": (Sit, {}),
    "wrong": (Wrong, {"episode": _count, "step": _count}),
    "name": (Name, {"slot": _count, "word": _text}),
    "typed": (Typed, {"text": _text}),
    "counts as": (CountAs, {"text": _text, "slot": _count}),
}
