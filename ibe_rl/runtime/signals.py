"""Stops a program gracefully, and starts processes that leave signals to their parent."""

from __future__ import annotations

import multiprocessing.resource_tracker
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What a terminal, ``timeout`` or a batch system sends to all processes of a program."""
ONE_PRESS_S = 0.5
"""Seconds in which a second Ctrl-C is the same one: ``timeout -s INT`` sends it to a program and to its group."""


class StopRequest:
    """False until Ctrl-C, SIGTERM or the end of the terminal (SIGHUP) arrives; Ctrl-C after that ends at once.

    A further SIGTERM or SIGHUP changes nothing: batch systems, ``timeout`` and shells send several.
    A SIGHUP that is ignored, as under nohup, stays ignored.

    Use as a context manager in the main thread; leaving restores the previous handlers.
    """

    def __init__(self) -> None:
        self._asked = False
        self._pressed_s: float | None = None
        self._called: list[Callable[[], None]] = []

    def when_asked(self, call: Callable[[], None]) -> None:
        """Call a short function once when the request arrives, or now if it has."""
        self._called.append(call)
        if self._asked:
            self._call()

    def __bool__(self) -> bool:
        return self._asked

    def __enter__(self) -> StopRequest:
        asked_by = [
            number for number in _ASKING if signal.getsignal(number) != signal.SIG_IGN or number != signal.SIGHUP
        ]
        self._before = {number: signal.signal(number, self._ask) for number in asked_by}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _ask(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGINT:
            now = time.monotonic()
            same = self._pressed_s is not None and now - self._pressed_s < ONE_PRESS_S
            if self._asked and not same:
                raise KeyboardInterrupt
            self._pressed_s = now if self._pressed_s is None else self._pressed_s
        self._asked = True
        self._call()

    def _call(self) -> None:
        while self._called:
            self._called.pop(0)()


@contextmanager
def interrupts_stay_here() -> Iterator[None]:
    """Start processes that no request to stop reaches; the parent stops them gracefully."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    multiprocessing.resource_tracker.ensure_running()  # starting it later would unblock the other two again
    signal.pthread_sigmask(signal.SIG_BLOCK, _ASKING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ASKING)


def leave_sigterm_to_parent() -> None:
    """In a process started so: do nothing at SIGTERM, but let what this process starts be ended by it."""
    signal.signal(signal.SIGTERM, lambda *_: None)  # unlike a blocked signal, a handler is not inherited by programs
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})


@contextmanager
def script_stays_here() -> Iterator[None]:
    """Start processes without the main script, whose imports they would load but not use."""
    names = vars(sys.modules["__main__"])
    file = names.pop("__file__", None)
    try:
        yield
    finally:
        if file is not None:
            names["__file__"] = file
