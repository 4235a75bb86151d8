"""What is said: an environment's phrases for numbers, or the words of whoever teaches.

With words of one's own an instruction is a row of ``d`` slots, 1 for the word that is given and 0 elsewhere. The number
of slots is fixed from the start; words that are added later take free ones.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from string import Formatter
from typing import Any, Self, overload

import numpy as np

MOST_WORDS, LONGEST_WORD, PHRASES_KEPT = 12, 40, 30
DEGREES = ((0.3, "slightly "), (0.4, "moderately "), (0.9, ""))
"""Words for how much, for ``Phrases.degrees``, where a task needs no others.

The largest movement of a vocabulary has the magnitude 1. The limits lie where default vocabularies have no clusters:
theirs are at 0 to .24, .51 to .84, and 1 (docs/LOG.md)."""


@dataclass(frozen=True)
class Phrases:
    """The words for one number of an expression.

    Attributes:
        zero: said while the magnitude is below the first limit of ``degrees``.
        negative: template with ``{degree}`` for the other expressions below 0.
        positive: the same above 0.
        degrees: pairs (lower limit of the magnitude, word for ``{degree}``), rising.

    Raises:
        ValueError: naming what is none of these.
    """

    zero: str
    negative: str
    positive: str
    degrees: Sequence[tuple[float, str]]

    def __post_init__(self) -> None:
        for words in (self.zero, self.negative, self.positive):
            if not isinstance(words, str):
                raise ValueError(f"phrase {words!r}: allowed is a text")
        for words in (self.negative, self.positive):
            if not _has_only_degree(words):
                raise ValueError(f"phrase {words!r}: allowed in braces is {{degree}} only; {{{{ is a brace to be said")
        try:
            rises = [limit for limit, word in self.degrees] == sorted({float(limit) for limit, word in self.degrees})
            fits = rises and all(isinstance(word, str) for _, word in self.degrees) and len(self.degrees) > 0
        except (TypeError, ValueError):
            fits = False
        if not fits:
            raise ValueError(
                f"degrees={self.degrees}: allowed are pairs (lower limit, word) with rising limits, at least one"
            )


def _has_only_degree(template: str) -> bool:
    try:
        fields = [(name, spec, how) for _, name, spec, how in Formatter().parse(template) if name is not None]
    except ValueError:
        return False
    return all(one == ("degree", "", None) for one in fields)


class WordError(ValueError):
    """What cannot be a word, or not one more; the message names it and what is allowed."""


@dataclass(frozen=True)
class Word:
    """One word of an instructor.

    Attributes:
        word: as it is said and shown.
        added_at_frame: training frames when it was added; 0: from the start.
        renamed_from: its earlier names, the oldest first.
        phrases: other texts that say it, the newest ``PHRASES_KEPT``.
    """

    word: str
    added_at_frame: int = 0
    renamed_from: tuple[str, ...] = ()
    phrases: tuple[str, ...] = ()


class Words(Sequence[Phrases]):
    """The words of whoever teaches, which take the place of an environment's ``Phrases``.

    One object is shared by all that speak in a run, so that a word that is added or renamed is so everywhere.

    Args:
        words: texts, at least one.
        slots: most words there can be, the size ``d`` of an instruction; None: as many as there are.

    Raises:
        WordError: naming the word and what is allowed.
    """

    def __init__(self, words: Iterable[str | Word], slots: int | None = None):
        self._entries: list[Word] = []
        given = [one if isinstance(one, Word) else Word(one) for one in words]
        self.slots = len(given) if slots is None else slots
        if not given or len(given) > MOST_WORDS:
            raise WordError(f"instructor.words={[one.word for one in given]}: allowed are 1 to {MOST_WORDS} words")
        if not len(given) <= self.slots <= MOST_WORDS:
            raise WordError(f"instructor.max_words={slots}: allowed are {len(given)} (its words) to {MOST_WORDS}")
        for one in given:
            try:
                phrases = tuple(map(clean, one.phrases[-PHRASES_KEPT:]))
                self._entries.append(replace(one, word=self._free(one.word), phrases=phrases))
            except WordError as error:
                raise WordError(f"instructor.words: {error}") from None

    @property
    def entries(self) -> tuple[Word, ...]:
        """The words, by slot."""
        return tuple(self._entries)

    @property
    def names(self) -> tuple[str, ...]:
        """The words as texts, by slot."""
        return tuple(one.word for one in self._entries)

    def name_at(self, slot: int) -> str:
        """The word of a slot, or that it is free."""
        return self._entries[slot].word if slot < len(self._entries) else FREE_SLOT

    def slot_of(self, text: str) -> int | None:
        """The slot of a word, or of the word that a phrase says; None if there is neither."""
        by_phrase = (slot for slot, one in enumerate(self._entries) if _among(text, one.phrases))
        return next((slot for slot, name in enumerate(self.names) if _among(text, [name])), next(by_phrase, None))

    def one_hot(self, slot: int) -> np.ndarray:
        """The instruction ``(d,)`` that gives the word of a slot."""
        return np.eye(self.slots, dtype=np.float32)[slot]

    def add(self, text: str, frame: int = 0) -> int:
        """Add a word; returns its slot.

        Raises:
            WordError: if there is no free slot, or the text is no word or one that exists.
        """
        if len(self._entries) >= self.slots:
            raise WordError(f"word {text!r}: all {self.slots} places are taken; allowed is to rename one of them")
        word = self._free(text)
        self._no_phrase_of_any(word)
        self._entries.append(Word(word, frame))
        return len(self._entries) - 1

    def count_as(self, slot: int, text: str) -> None:
        """Let a text be another way to say the word of a slot, and of no other word any more.

        Raises:
            WordError: if it is no text, or a word itself.
        """
        phrase = clean(text)
        if _among(phrase, self.names):
            raise WordError(f"phrase {phrase!r}: it is a word itself; allowed is a text that is none")
        self._no_phrase_of_any(phrase)
        old = self._entries[slot]
        self._entries[slot] = replace(old, phrases=(*old.phrases, phrase)[-PHRASES_KEPT:])

    def _no_phrase_of_any(self, text: str) -> None:
        kept = [tuple(one for one in each.phrases if alike(one) != alike(text)) for each in self._entries]
        self._entries = [replace(each, phrases=left) for each, left in zip(self._entries, kept, strict=True)]

    def rename(self, slot: int, text: str) -> None:
        """Give a word another name; what has been learnt of it stays.

        Raises:
            WordError: if the text is no word or that of another slot.
        """
        old = self._entries[slot]
        new = self._free(text, but=slot)
        if new != old.word:
            self._no_phrase_of_any(new)
            named = replace(self._entries[slot], word=new, renamed_from=(*old.renamed_from, old.word))
            self._entries[slot] = named

    def to_dicts(self) -> list[dict[str, Any]]:
        """For JSON: a dict a word."""
        names = ("word", "added_at_frame", "renamed_from", "phrases")
        return [{name: getattr(one, name) for name in names} for one in self._entries]

    @classmethod
    def from_dicts(cls, values: Any, slots: int | None = None) -> Self:
        """The inverse of ``to_dicts``; raises ValueError if the values are no words."""
        try:
            return cls([_word_from(one) for one in values], slots)
        except (KeyError, TypeError) as error:
            raise ValueError(f"no list of words ({type(error).__name__}: {error})") from None

    def become(self, other: Words) -> None:
        """Take over the words of another one with as many slots, as read from a run folder."""
        self._entries = list(other.entries)

    def _free(self, text: str, but: int | None = None) -> str:
        word = clean(text)
        if _among(word, [name for slot, name in enumerate(self.names) if slot != but]):
            raise WordError(f"word {word!r}: it is there already; allowed are words that differ")
        return word

    def __len__(self) -> int:
        """``d``, the slots."""
        return self.slots

    @overload
    def __getitem__(self, at: int) -> Phrases: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[Phrases]: ...
    def __getitem__(self, at: int | slice) -> Phrases | Sequence[Phrases]:
        """One word alone as ``Phrases``: said, or not."""
        if isinstance(at, slice):
            return [self[slot] for slot in range(*at.indices(self.slots))]
        if not 0 <= at < self.slots:
            raise IndexError(at)
        name = self.name_at(at).replace("{", "{{").replace("}", "}}")
        return Phrases(f"not {name}", f"not {name}", name, ((0.5, ""),))


FREE_SLOT = "(no word yet)"
_HIDDEN = ("Cc", "Cs", "Co", "Cn", "Zl", "Zp")
_TURNS_TEXT = "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
"""Signs that change the direction of all text after them."""


def clean(text: str) -> str:
    """A word as it is stored: one line, without spaces around it, in the composed form of Unicode.

    Raises:
        WordError: if it is no text, empty, too long or has characters that cannot be shown.
    """
    if not isinstance(text, str):
        raise WordError(f"word {text!r}: allowed is a text; put it in quotation marks")
    if bad := [one for one in text if unicodedata.category(one) in _HIDDEN or one in _TURNS_TEXT]:
        raise WordError(f"word {text[:20]!r}: {bad[0]!r} cannot be shown; allowed are letters, digits and signs")
    word = " ".join(unicodedata.normalize("NFC", text).split())
    if not word:
        raise WordError(f"word {text!r}: it is empty; allowed are 1 to {LONGEST_WORD} characters")
    if len(word) > LONGEST_WORD:
        raise WordError(f"word {word[:20]!r}...: {len(word)} characters; allowed are 1 to {LONGEST_WORD}")
    return word


def _word_from(values: Any) -> Word:
    earlier, phrases = values["renamed_from"], values.get("phrases", ())  # older runs have no phrases
    return Word(values["word"], int(values["added_at_frame"]), tuple(map(str, earlier)), tuple(map(str, phrases)))


def _among(text: str, texts: Iterable[str]) -> bool:
    return alike(text) in map(alike, texts)


def alike(text: str) -> str:
    """Words that agree in this are one word: case and width of letters do not count."""
    return unicodedata.normalize("NFKC", text).casefold().strip()
