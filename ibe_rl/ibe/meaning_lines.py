"""What is known of the words of an instructor, a line for each number of an instruction."""

from __future__ import annotations

from collections.abc import Sequence

from ibe_rl.ibe.meaning import Meaning
from ibe_rl.task import Phrases, Task

NOBODY_ASKED = "nobody has looked into what its words mean"


def meaning_lines(meanings: Sequence[Meaning], task: Task) -> list[str]:
    """Say what is known of the words, wherever a run is shown.

    Args:
        meanings: of a vocabulary; empty if nobody has asked.
        task: the environment's own.

    Returns:
        One line for each number: which words are known and on what that stands, or why it cannot be told.
    """
    if not meanings:
        return [NOBODY_ASKED]
    return [_line(meaning, words) for meaning, words in zip(meanings, task.phrases, strict=True)]


def _line(meaning: Meaning, words: Phrases) -> str:
    sides = {_plain(words.positive): meaning.positive, _plain(words.negative): meaning.negative}
    known = [side for side, is_known in sides.items() if is_known]
    if not known:
        return f"I cannot tell what {_quoted(_plain(words.positive))} means{_because(meaning)}"
    told = f"it is known what {' and '.join(map(_quoted, known))} {'means' if len(known) == 1 else 'mean'}"
    unknown = [side for side, is_known in sides.items() if not is_known]
    but = f", but I cannot tell what {_quoted(unknown[0])} means" if unknown else ""
    return f"{told}{but}{_because(meaning)}"


def _because(meaning: Meaning) -> str:
    return f": {meaning.reason}" if meaning.reason else ""


def _plain(template: str) -> str:
    """A phrase without its degree."""
    return " ".join(template.format(degree="").split())


def _quoted(words: str) -> str:
    return f"“{words}”"


def positive_phrase(words: Phrases) -> str:
    """What +1 is called, without any degree, in quotation marks."""
    return _quoted(_plain(words.positive))
