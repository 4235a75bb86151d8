"""The verdict from a motion AUC: do the words predict the direction of motion?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ibe_rl.ibe.meaning import Meaning
from ibe_rl.ibe.meaning_lines import asked
from ibe_rl.task import Task

GOOD, WEAK, REVERSED, UNKNOWN = "good", "weak", "reversed", "unknown"
WORST_FIRST = (REVERSED, UNKNOWN, WEAK, GOOD)
CHANCE, GOOD_FROM, WEAK_FROM, REVERSED_BELOW = 0.5, 0.9, 0.6, 0.4
NO_MEANING = "the meaning of its words is not known"
NOT_MEASURED = "cannot be measured"
NO_BETTER = "no better than chance"
AN_ECHO = "no better than repeating the last instruction"


@dataclass(frozen=True)
class Verdict:
    """The verdict on a motion AUC.

    Attributes:
        level: one of ``WORST_FIRST``.
        why: the reason for the level: ``NO_MEANING``, ``NOT_MEASURED``, ``NO_BETTER``, ``AN_ECHO`` or empty.
        motion_auc: of the words; NaN where undefined.
        echo_auc: of the last instruction in their place; NaN where undefined.
        interval: 95 % interval of ``motion_auc``, None without one.
        number: name of the number of the instruction; empty if there is only one.
    """

    level: str
    why: str
    motion_auc: float
    echo_auc: float
    interval: tuple[float, float] | None = None
    number: str = ""

    @property
    def figures(self) -> str:
        """The values in words: ".04, reversed (chance .50, repeating the last instruction .61)"."""
        if self.why in (NO_MEANING, NOT_MEASURED):
            found = self.why
        else:
            low_high = "" if self.interval is None else f" [{', '.join(map(short_number, self.interval))}]"
            found = f"{short_number(self.motion_auc)}{low_high}, {self.why or self.level}"
        echo = "" if math.isnan(self.echo_auc) else f", repeating the last instruction {short_number(self.echo_auc)}"
        return f"{self.number + ' ' if self.number else ''}{found} (chance {short_number(CHANCE)}{echo})"


def verdict(
    auc: float, echo_auc: float, known: bool, interval: tuple[float, float] | None = None, number: str = ""
) -> Verdict:
    """Derive the verdict from a motion AUC.

    Args:
        auc: of the words; NaN where undefined.
        echo_auc: of the last instruction in their place; NaN where undefined.
        known: whether the meaning of the words is known.
        interval: its 95 % interval, if there is one.
        number: see ``Verdict``.

    Returns:
        "unknown" if the meaning is unknown or the AUC is NaN, between .4 and .6, or not clear of chance;
        "reversed" below .4; "good" from .9 on if it is clear of the echo; else "weak".
    """
    return Verdict(*_level(auc, echo_auc, known, interval or (auc, auc)), auc, echo_auc, interval, number)


def _level(auc: float, echo_auc: float, known: bool, interval: tuple[float, float]) -> tuple[str, str]:
    low, high = interval
    if not known:
        return UNKNOWN, NO_MEANING
    if math.isnan(auc):
        return UNKNOWN, NOT_MEASURED
    if REVERSED_BELOW <= auc < WEAK_FROM or low <= CHANCE <= high:
        return UNKNOWN, NO_BETTER
    if auc < CHANCE:
        return REVERSED, ""
    if low <= echo_auc:
        return WEAK, AN_ECHO
    return (GOOD if auc >= GOOD_FROM else WEAK), ""


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """The worst verdict over the numbers, as a mean would hide a reversed one."""
    return min(verdicts, key=lambda one: WORST_FIRST.index(one.level))


def verdicts_of(scores: Sequence[Mapping[str, float]], meanings: Sequence[Meaning], task: Task) -> list[Verdict]:
    """The verdict on each number of the instruction.

    Args:
        scores: of each number, see ``number_scores``; may be empty.
        meanings: of the vocabulary; if empty, all count as known.
        task: the environment's own.
    """
    nothing: list[Mapping[str, float]] = [{}] * len(task.explained)
    return [
        verdict(
            each.get("motion_auc", math.nan),
            each.get("echo_auc", math.nan),
            is_meant(meanings, number),
            number=name if len(task.explained) > 1 else "",
        )
        for number, (each, name) in enumerate(zip(scores or nothing, task.number_names, strict=True))
    ]


def is_meant(meanings: Sequence[Meaning], number: int) -> bool:
    """Whether the meaning is known of a number, or of any word."""
    if not meanings or meanings[0].moves:
        return not meanings or any(one.known for one in meanings)
    return meanings[number].known


def in_one_line(verdicts: Sequence[Verdict]) -> str:
    """The verdicts in one line, shown next to the phrase accuracy."""
    return f"AUC of its words for the direction of motion: {'; '.join(one.figures for one in verdicts)}"


def wrong_signs(verdicts: Sequence[Verdict], meanings: Sequence[Meaning], task: Task) -> list[str]:
    """A line for each number whose words are known but contradict the sign that the environment declares.

    Empty without ``meanings``: the words themselves may then be wrong.
    """
    if not meanings or task.words is not None:
        return []
    numbers = zip(verdicts, task.number_names, task.explained, meanings, strict=True)
    return [
        f"env.task.explained=[{name}] says that {name} rises with +1, but in the log +1 asks "
        + ("it to fall: check the sign" if _falls(meaning, dimension) else f"{asked(meaning, task)}: check the name")
        for one, name, dimension, meaning in numbers
        if one.level == REVERSED
    ]


def _falls(meaning: Meaning, dimension: int) -> bool:
    """Whether +1 asks a dimension to fall; assumed if its direction is unknown, as the verdict is reversed."""
    return not meaning.direction or meaning.direction[dimension] < 0


def short_number(value: float) -> str:
    """Two digits without the 0 before the point, as AUCs are written.

    >>> short_number(0.044), short_number(1.0)
    ('.04', '1.00')
    """
    return f"{value:.2f}".removeprefix("0")
