"""Phrases without the words that all of them begin with, and what is said at one step of an episode."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from ibe_rl.ibe.mapping import movements_said
from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.task import Phrases
from ibe_rl.task.words import Words
from ibe_rl.types import CANNOT_TELL, DOES_NOT_KNOW, Explanation

_MARKS = re.compile(r"[\\`*\[\]<>|~$&]|(?<!\w)_|_(?!\w)")
"""What markdown would take for its own."""
SILENCE = "(silent)"
"""Told where the instructor says nothing."""
LONGEST_LABEL = 52
"""Characters that fit into the picture at 1440 x 900."""


def shared_words(words: Sequence[Phrases]) -> int:
    """How many words all phrases of a language begin with; they can be left out where room is short.

    >>> shared_words([Phrases("going up", "going {degree}left", "going {degree}right", ((0.2, ""),))])
    1
    """
    if isinstance(words, Words):
        return 0
    spoken = [phrase(np.full(len(words), value), words).split() for value in np.linspace(-1, 1, 81)]
    shared = 0
    while len({tuple(one[: shared + 1]) for one in spoken}) == 1 and min(map(len, spoken)) > shared + 1:
        shared += 1
    return shared


def shortener(words: Sequence[Phrases]) -> Callable[[str], str]:
    """From a phrase to the same without the words that all of the language begin with."""
    shared = shared_words(words)
    if not shared:
        return str
    return lambda said: said if said in (DOES_NOT_KNOW, CANNOT_TELL) else " ".join(said.split()[shared:])


def short(phrases: Sequence[str], words: Sequence[Phrases]) -> list[str]:
    """Phrases without the words that all of the language begin with."""
    return [*map(shortener(words), phrases)]


def literal(text: str) -> str:
    """A text that markdown shows as it is, on one line of it."""
    return _MARKS.sub(r"\\\g<0>", text)


def said_lines(instructed: str, explanation: Explanation) -> str:
    """What it is told and what it says at one step, in markdown, in the words of the columns of ``explain.py``.

    Several numbers would not fit into the line; the curves show them.
    """
    [numbers] = movements_said([explanation])
    known = [f"expression {value:+.2f}" for value in numbers] if explanation.meant else []
    if explanation.in_words and known:
        known = [f"share {numbers.max():.0%}"]
    shown = known if len(known) == 1 else []
    if known and explanation.calibrated:
        shown = [*shown, f"confidence {explanation.confidence:.0%}"]
    says = "  \n".join(f"{span_name(one.horizon_steps)}: **{literal(one.said)}**" for one in explanation.all_spans)
    return f"instruction: **{literal(instructed)}**  \n{says}" + (f" ({', '.join(shown)})" if shown else "")


def span_name(horizon_steps: int) -> str:
    """What a span of time is called, in the picture and in the terminal."""
    return "next step" if horizon_steps == 1 else f"next {horizon_steps} steps"


def in_lines(label: str) -> str:
    """A label of the picture: what is said of later is below what is said of now, where both would not fit."""
    return label.replace(", later ", ",\nlater ") if len(label) > LONGEST_LABEL else label


def verdict_line(steps_ago: int, said: str, happened: str) -> str:
    """What was said of the time up to now, and whether it went as predicted.

    Of what no word was said of, only that is told.
    """
    ago = "1 step ago" if steps_ago == 1 else f"{steps_ago} steps ago"
    if said == CANNOT_TELL:
        return f"{ago} it could not tell"
    outcome = "it did" if said == happened else f"it was {happened}"
    if happened == CANNOT_TELL:
        outcome = "it did something else, which it has no known word for"
    return f"said {ago}: {said}: {outcome}"
