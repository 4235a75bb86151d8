"""A thread that makes calls one after the other, so that the caller never waits for them."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from queue import Full, Queue
from threading import Thread

_Call = Callable[[], object]


class Background:
    """Makes calls in their order; the first that fails is the last.

    Args:
        most_waiting: number of calls that may wait; while there are as many, further ones are left out.

    Attributes:
        left_out: number of calls that were left out.
    """

    def __init__(self, most_waiting: int) -> None:
        self.left_out = 0
        self._calls: Queue[_Call | None] = Queue(most_waiting)
        self._error: Exception | None = None
        self._thread = Thread(target=self._work, name="logger", daemon=True)
        self._thread.start()

    def do(self, call: _Call) -> None:
        """Have a call made; returns at once.

        Raises:
            Exception: of an earlier call.
        """
        self._raise()
        try:
            self._calls.put_nowait(call)
        except Full:
            self.left_out += 1

    def finish(self, call: _Call, timeout_s: float) -> bool:
        """Have a last call made after all others; returns whether that was within ``timeout_s`` seconds.

        Raises:
            Exception: of this or an earlier call.
        """
        self._raise()
        end = time.monotonic() + timeout_s
        with suppress(Full):
            for last in (call, None):
                self._calls.put(last, timeout=max(0.0, end - time.monotonic()))
        self._thread.join(max(0.0, end - time.monotonic()))
        self._raise()
        return not self._thread.is_alive()

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        try:
            while (call := self._calls.get()) is not None:
                call()
        except Exception as error:  # a logger's own package may raise anything
            self._error = error
