"""Lines for people: what is known of the meaning of each number of an instruction."""

from __future__ import annotations

from collections.abc import Sequence

from ibe_rl.ibe.meaning import Meaning
from ibe_rl.task import Phrases, Task

MIN_NAMED_SHARE = 0.4
"""Dimensions are named that +1 asks to move by at least this share of the largest."""
PAYS = {1: "following is rewarded", 0: "whether following is rewarded is unclear", -1: "following is not rewarded"}
NOT_INFERRED = "the meaning of its words has not been inferred"


def meaning_lines(meanings: Sequence[Meaning], task: Task) -> list[str]:
    """One line for each number: which of its words are known and from which evidence, or why they are not.

    ``meanings`` are empty if the vocabulary was learnt without an interpretation.
    """
    if not meanings:
        return [NOT_INFERRED]
    if task.words is not None:
        return word_lines(meanings, task)
    return [_line(meaning, words, task) for meaning, words in zip(meanings, task.phrases, strict=True)]


def word_lines(meanings: Sequence[Meaning], task: Task) -> list[str]:
    """One line for each word: which dimensions rise and fall after it, or why its meaning is unknown."""
    assert task.words is not None
    lines = []
    for meaning, word in zip(meanings, task.words.names, strict=False):
        if meaning.known:
            lines.append(f"{_quoted(word)}: {moves_to(meaning, task)}")
        else:
            lines.append(f"{_quoted(word)} means nothing to me yet: {meaning.reason}")
    return lines


def moves_to(meaning: Meaning, task: Task) -> str:
    """Which state dimensions go on to rise and to fall after a word, more than after the others."""
    found = asked(meaning, task)
    return f"{found}, compared with the other words" if any(meaning.direction) else found


def _line(meaning: Meaning, words: Phrases, task: Task) -> str:
    sides = {_plain(words.positive): meaning.positive, _plain(words.negative): meaning.negative}
    known = [side for side, is_known in sides.items() if is_known]
    if not known:
        because = f": {meaning.reason}" if meaning.reason else ""
        return f"I cannot tell what {_quoted(_plain(words.positive))} means{because}{_facts(meaning)}"
    line = f"{' and '.join(map(_quoted, known))}: +1 asks {asked(meaning, task)}"
    unknown = [side for side, is_known in sides.items() if not is_known]
    but = f", but I cannot tell what {_quoted(unknown[0])} means" if unknown else ""
    because = f", {meaning.reason}" if meaning.reason else ""
    return f"{line}{because}{but}{_facts(meaning)}"


def asked(meaning: Meaning, task: Task) -> str:
    """Which state dimensions +1 asks to rise and to fall, the most important ones: "x to rise"."""
    named = [
        (name, each)
        for name, each in zip(task.state_names, meaning.direction, strict=False)
        if abs(each) >= MIN_NAMED_SHARE
    ]
    ways = {"rise": [name for name, each in named if each > 0], "fall": [name for name, each in named if each < 0]}
    return " and ".join(f"{', '.join(names)} to {way}" for way, names in ways.items() if names) or "for a movement"


def _facts(meaning: Meaning) -> str:
    """Whether the instruction is followed and whether that pays, which the paper assumes; and how many episodes.

    Only the episodes where the sign is not known at all.
    """
    has_sign = meaning.known or meaning.effect_of("satisfaction") is not None
    best, pays = (meaning.effect_of(source) if has_sign else None for source in ("best", "pays"))
    parts = []
    if best is not None:
        parts.append(f"the best episodes moved {best.effect:+.2f} standard deviations the instructed way")
    if pays is not None:
        parts.append(PAYS[pays.sign])
    if meaning.episodes:
        parts.append(f"{meaning.episodes} episodes")
    return f" ({'; '.join(parts)})" if parts else ""


def _plain(template: str) -> str:
    """A phrase without its degree."""
    return " ".join(template.format(degree="").split())


def _quoted(words: str) -> str:
    return f"“{words}”"


def positive_phrase(words: Phrases) -> str:
    """The phrase for +1 without a degree, in quotation marks."""
    return _quoted(_plain(words.positive))
