"""Brings what an endpoint has collected from a bundle into the file of answers, through the same checks as a server."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ibe_rl.apps.study.answers import FILE, Answer, Answers
from ibe_rl.apps.study.folder import Study, hold_protocol, open_study
from ibe_rl.apps.study.messages import BadAnswerError, parse_answer
from ibe_rl.apps.study.sitting import ANSWER_TAKEN, take
from ibe_rl.types import ConfigError

MOST_NAMED = 10
_TAKEN, _REPEATED, _BEFORE, _OF_WITHDRAWN = "taken", "repeated", "answered before", "of people who withdrew"


@dataclass(frozen=True)
class CollectedMessage:
    """A line that a page has sent.

    Attributes:
        line: its number, from 1.
        id: of the message; the same when it was sent again.
        place: of the link.
        answer: None for a withdrawal.
    """

    line: int
    id: str
    place: str
    answer: Answer | None


@dataclass
class Collection:
    """What became of the lines of a file.

    Attributes:
        counts: of answers, by what became of them.
        refused: what is wrong, by its line.
        withdrew: how many people withdrew with this file.
    """

    counts: Counter[str] = field(default_factory=Counter)
    refused: dict[int, str] = field(default_factory=dict)
    withdrew: int = 0

    def __str__(self) -> str:
        known = [f"{self.counts[name]} {name}" for name in (_TAKEN, _REPEATED, _BEFORE, _OF_WITHDRAWN)]
        told = [f"answers: {', '.join(known)}", f"people who withdrew: {self.withdrew}"]
        told.append(f"lines refused: {len(self.refused)}")
        told += [f"  line {line}: {why}" for line, why in sorted(self.refused.items())[:MOST_NAMED]]
        more = len(self.refused) - MOST_NAMED
        return "\n".join([*told, *([f"  and {more} more"] if more > 0 else [])])


def collect_answers(folder: Path, file: Path, /) -> str:
    """Bring the answers that an endpoint has stored, a JSON message a line, into the study; again does no harm.

    Args:
        folder: of the study that the bundle was made of.
        file: what the endpoint has stored.

    Raises:
        ConfigError: if the study was changed, or there is no such file.
    """
    study = open_study(folder)
    try:
        lines = file.read_bytes().split(b"\n")
    except OSError as error:
        raise ConfigError(f"{file}: allowed is the file of the endpoint ({error.strerror})") from None
    with closing(Answers(folder / FILE)) as answers:
        hold_protocol(study, answers)
        return str(collect_lines(study, answers, lines))


def collect_lines(study: Study, answers: Answers, lines: Sequence[bytes]) -> Collection:
    """Take the messages of lines; who withdraws in any of them is deleted, and none of their answers is taken."""
    became = Collection()
    messages = list(_messages(lines, became))
    gone = {one.place for one in messages if one.answer is None}
    known = {one.token: one for one in answers.people(pilots=True, laid_out=True)}
    for place in sorted(gone & known.keys()):
        answers.withdraw(known[place])
        became.withdrew += 1
    seen: set[tuple[str, str]] = set()
    with answers.transaction():
        for one in messages:
            if one.place in gone:
                became.counts[_OF_WITHDRAWN] += one.answer is not None
            elif (one.place, one.id) in seen:
                became.counts[_REPEATED] += 1
            elif one.answer is not None:
                _take(study, answers, one.place, one.answer, one.line, became)
                seen |= {(one.place, one.id)} if one.line not in became.refused else set()
    return became


def _take(study: Study, answers: Answers, place: str, answer: Answer, line: int, became: Collection) -> None:
    person = answers.person(place)
    if person is None:
        became.refused[line] = "nobody has this place; it is of another study, or they have withdrawn"
        return
    try:
        became.counts[_TAKEN if take(study, answers, person, answer) == ANSWER_TAKEN else _BEFORE] += 1
    except BadAnswerError as error:
        became.refused[line] = str(error)


def _messages(lines: Sequence[bytes], became: Collection) -> Iterator[CollectedMessage]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                yield _message(number, line)
            except BadAnswerError as error:
                became.refused[number] = str(error)


def _message(number: int, line: bytes) -> CollectedMessage:
    """Read a line; what else an endpoint adds to a message is left out."""
    try:
        given: Any = json.loads(line)
    except (ValueError, RecursionError):
        raise BadAnswerError("no JSON") from None
    if not isinstance(given, dict) or not all(_is_name(given.get(name)) for name in ("id", "place")):
        raise BadAnswerError("allowed are id, place, and answer or withdraw")
    if given.get("withdraw") is True:
        return CollectedMessage(number, given["id"], given["place"], None)
    return CollectedMessage(number, given["id"], given["place"], parse_answer(json.dumps(given.get("answer"))))


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and value.isascii()
