"""The teaching session: which page instructs, and which instruction applies at which step.

It knows no network and no clock. The server's thread puts messages in; the environment takes one instruction a step.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ibe_rl.apps.teach.messages import (
    CountAs,
    HandOver,
    Message,
    Name,
    Pause,
    Press,
    Release,
    Sit,
    Speed,
    Typed,
    Wrong,
)
from ibe_rl.apps.teach.phrase_groups import Nearest
from ibe_rl.instructors.taught import MARKED_BEFORE
from ibe_rl.task.words import WordError, Words

ACCEPTED, WATCHING, REPEATED, PAST, UNKNOWN_VALUE = "accepted", "watching", "repeated", "past", "unknown value"
"""The result of a message; all but the first change nothing."""
PERSON, HELD, ORACLE, NOBODY = "person", "held", "oracle", "nobody"
"""The source of a step's instruction."""


@dataclass(frozen=True)
class Said:
    """The instruction at one step.

    Attributes:
        value: the instruction, of words the slot; None if there is none or the rule is asked.
        by: one of ``PERSON``, ``HELD``, ``ORACLE``, ``NOBODY``.
        heard: number of the newest press or release that it includes, 0 before the first.
        wrong: an explanation that the person has called wrong since the last step.
    """

    value: float | None
    by: str
    heard: int
    wrong: Wrong | None = None


@dataclass(frozen=True)
class Controls:
    """The pace of the environment: ``speed`` in multiples of real time, None as fast as possible."""

    paused: bool
    speed: float | None
    oracle: bool


class TeachingSession:
    """One person at a time instructs; others watch.

    The first page to join instructs. When it leaves, its press is released, and the next page to join or ask may
    instruct. A press applies to the episode that the person sees; one that arrives later is ignored. It applies at
    each step until its release, and to at least one step. Of two presses between two steps the later one applies.

    Args:
        values: the possible instructions, where these are numbers.
        hold_steps: how long an instruction lasts after its release, within the episode; None until its end.
        speed: initial speed.
        words: the possible instructions, where these are words; a page may rename them and add some.
        nearest: finds the word that a typed text says; None: each text is a word.

    Attributes:
        changed: condition notified whenever the pace may have changed.
    """

    def __init__(
        self,
        values: Sequence[float],
        hold_steps: int | None,
        speed: float | None,
        words: Words | None = None,
        nearest: Nearest | None = None,
    ):
        self.changed = threading.Condition()
        self._values, self._hold_steps, self.words = tuple(values), hold_steps, words
        self._nearest: Nearest = nearest or (lambda _text, _words: None)
        self._controls = Controls(paused=False, speed=speed, oracle=False)
        self._present: dict[int, int] = {}  # each page and the number of its newest press or release
        self._chair: int | None = None
        self._episode = 0
        self._pressed: float | None = None
        self._down = self._taken = False
        self._last: float | None = None
        self._since_steps = 0
        self._wrong: list[Wrong] = []
        self._called: list[Callable[[], None]] = []

    @property
    def controls(self) -> Controls:
        """The current controls."""
        with self.changed:
            return self._controls

    @property
    def chair(self) -> int | None:
        """The page that instructs."""
        with self.changed:
            return self._chair

    def join(self, page: int) -> None:
        """A page has connected."""
        with self.changed:
            self._present[page] = 0
            if self._chair is None:
                self._take_chair(page)

    def when_seated(self, call: Callable[[], None]) -> None:
        """Call a short function once as soon as a page instructs, or now if one does."""
        with self.changed:
            self._called.append(call)
            if self._chair is not None:
                self._take_chair(self._chair)

    def _take_chair(self, page: int) -> None:
        self._chair = page
        while self._called:
            self._called.pop(0)()

    def leave(self, page: int) -> None:
        """A page has gone: its press is released, and its pause ends."""
        with self.changed:
            self._present.pop(page, None)
            if self._chair == page:
                self._chair, self._controls = None, Controls(False, self._controls.speed, self._controls.oracle)
                self._silence()
                self.changed.notify_all()

    def hear(self, page: int, message: Message) -> str:
        """Process a page's message; returns its result."""
        with self.changed:
            if isinstance(message, Sit):
                return self._sit(page)
            if page != self._chair:
                return WATCHING
            if isinstance(message, Press | Release):
                return self._set_instruction(page, message)
            if isinstance(message, Wrong):
                return self._mark(message)
            if isinstance(message, Name | Typed | CountAs):
                return self._change_words(message)
            self._control(message)
            return ACCEPTED

    def begin(self, episode: int) -> None:
        """Begin an episode, without an instruction."""
        with self.changed:
            self._episode = episode
            self._wrong = [one for one in self._wrong if one.episode >= episode - MARKED_BEFORE]
            self._silence()

    def take(self) -> Said:
        """The instruction at this step; called once a step."""
        with self.changed:
            heard = 0 if self._chair is None else self._present[self._chair]
            pressed, self._taken = self._pressed, True
            self._pressed = pressed if self._down else None
            said = Said(None, ORACLE, heard) if self._controls.oracle else self._said_now(pressed, heard)
            return replace(said, wrong=self._wrong.pop(0)) if self._wrong else said

    def _said_now(self, pressed: float | None, heard: int) -> Said:
        if pressed is not None:
            self._last, self._since_steps = pressed, 0
            return Said(pressed, PERSON, heard)
        if self._last is not None and (self._hold_steps is None or self._since_steps < self._hold_steps):
            self._since_steps += 1
            return Said(self._last, HELD, heard)
        return Said(None, NOBODY, heard)

    def _sit(self, page: int) -> str:
        if page not in self._present or self._chair not in (None, page):
            return WATCHING
        self._take_chair(page)
        return ACCEPTED

    def _set_instruction(self, page: int, message: Press | Release) -> str:
        if message.sequence <= self._present[page]:
            return REPEATED
        value = self._value_of(message.value) if isinstance(message, Press) else None
        if isinstance(message, Press) and value is None:
            return UNKNOWN_VALUE
        self._present[page] = message.sequence
        if message.episode != self._episode:
            return PAST
        if isinstance(message, Press):
            self._pressed, self._down, self._taken = value, True, False
        else:
            self._down = False
            self._pressed = None if self._taken else self._pressed
        return ACCEPTED

    def _value_of(self, said: float | str) -> float | None:
        """The instruction of a press; None if it is not one of the possible ones."""
        if self.words is not None:
            return self.words.slot_of(said) if isinstance(said, str) else None
        return said if not isinstance(said, str) and said in self._values else None

    def _change_words(self, message: Name | Typed | CountAs) -> str:
        if self.words is None:
            return "instructions are numbers here, and have no names"
        try:
            if isinstance(message, Name):
                self._name(self.words, message)
            else:
                near = message.slot if isinstance(message, CountAs) else self._nearest(message.text, self.words)
                self._count(self.words, message.text, near)
        except WordError as error:
            return str(error)
        return ACCEPTED

    def _name(self, words: Words, message: Name) -> None:
        if message.slot < len(words.names):
            words.rename(message.slot, message.word)
        else:
            words.add(message.word)

    def _count(self, words: Words, text: str, slot: int | None) -> None:
        if slot is None or slot >= len(words.names):
            words.add(text)
        else:
            words.count_as(slot, text)

    def _mark(self, message: Wrong) -> str:
        if not self._episode - MARKED_BEFORE <= message.episode <= self._episode:
            return PAST
        if message not in self._wrong:
            self._wrong.append(message)
        return ACCEPTED

    def _control(self, message: Pause | Speed | HandOver) -> None:
        now = self._controls
        if isinstance(message, Pause):
            self._controls = Controls(message.on, now.speed, now.oracle)
        elif isinstance(message, Speed):
            self._controls = Controls(now.paused, message.times, now.oracle)
        else:
            self._controls, self._last = Controls(now.paused, now.speed, message.on), None
        self.changed.notify_all()

    def _silence(self) -> None:
        self._pressed = self._last = None
        self._down = self._taken = False
        self._since_steps = 0
