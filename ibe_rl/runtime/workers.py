"""Processes that work for the trainer: none outlives it, and one that dies or hangs is noticed in a bounded time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from queue import Empty, SimpleQueue
from threading import Thread, Timer
from typing import Any, Protocol

POLL_S = 0.2
ANSWER_S = 3.0
"""So long a worker that is not busy may take to answer."""
START_S = 60.0
"""So long workers may take to be ready, if they are not given longer for a batch: they import much."""


class LostWorkerError(RuntimeError):
    """A worker that has died or hangs; the message names it, and what can be done."""


def end_with_parent(farewell_s: float = 0.0) -> None:
    """Let this process end as soon as the one that started it is gone, however that ended; call it in the new one.

    Args:
        farewell_s: so much longer it may take to say so.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel, farewell_s), daemon=True).start()


def _end_after(sentinel: int, farewell_s: float) -> None:
    wait([sentinel])
    time.sleep(farewell_s)
    os._exit(1)


class Workers(Protocol):
    """Those who collect, as one sees them who waits for their batches."""

    names: list[str]
    """None if there are no others than the trainer itself."""

    def dead(self, error: Exception | None = None) -> list[str]:
        """Those who have ended, and how; ``error`` is what ended the collecting, if anything did."""

    def silent(self) -> list[str]:
        """Those who do not answer; takes up to ``ANSWER_S``."""

    def kill(self) -> None:
        """End them all at once."""


class Processes:
    """The processes of TorchRL's collector.

    Args:
        processes: of ``MultiSyncCollector``; TorchRL itself closes those that live when it finds one that does not.
        pipes: to each of them.
    """

    def __init__(self, processes: Sequence[Any] = (), pipes: Sequence[Any] = ()):
        self._processes, self._pipes = list(processes), list(pipes)
        self.names = [f"worker {i} of {len(processes)} (process {one.pid})" for i, one in enumerate(processes)]

    def dead(self, error: Exception | None = None) -> list[str]:
        """See ``Workers``."""
        if error is not None:
            time.sleep(POLL_S)  # the system may be later than the error
        codes = [_exit_code(process) for process in self._processes]
        found = [(code, name) for code, name in zip(codes, self.names, strict=True) if code is not None]
        own = [pair for pair in found if pair[0] != -signal.SIGTERM]  # with that TorchRL ends the others
        return [f"{name} has ended ({ending(code)})" for code, name in own or found]

    def silent(self) -> list[str]:
        """See ``Workers``."""
        for pipe in self._pipes:
            with suppress(OSError, ValueError):
                pipe.send(("closed", "get_distant_attr"))  # any question that TorchRL's worker answers between batches
        until = time.monotonic() + ANSWER_S
        heard = [_answers(pipe, until) for pipe in self._pipes]
        return [name for name, answered in zip(self.names, heard, strict=True) if not answered]

    def kill(self) -> None:
        """See ``Workers``."""
        kill(self._processes)


def ending(exit_code: int) -> str:
    """How a process has ended, by its exit code as ``multiprocessing`` gives it."""
    return signal.Signals(-exit_code).name if exit_code < 0 else f"exit status {exit_code}"


def _exit_code(process: Any) -> int | None:
    try:
        code: int | None = process.exitcode
    except ValueError:  # TorchRL has closed it
        return None
    return code


def _answers(pipe: Any, until: float) -> bool:
    try:
        return bool(pipe.poll(max(0.0, until - time.monotonic())))
    except (OSError, ValueError):
        return False


def kill(processes: Iterable[Any]) -> None:
    """End processes at once, those too that hang, and wait for their end."""
    for process in processes:
        with suppress(ValueError):  # TorchRL has closed it
            process.kill()
            process.join(ANSWER_S)


@contextmanager
def starting(timeout_s: float | None) -> Iterator[None]:
    """Start processes that have to be ready by the end of this block.

    Args:
        timeout_s: so long it may take, or ``START_S`` if that is longer; None: as long as it likes.

    Raises:
        LostWorkerError: if one of them dies on the way, or they were not ready in time and had to be killed.
    """
    before = multiprocessing.active_children()
    late: list[Any] = []

    def give_up() -> None:
        late.extend(process for process in multiprocessing.active_children() if process not in before)
        kill(late)

    allowed_s = max(timeout_s or 0.0, START_S)
    timer = Timer(allowed_s, give_up)
    timer.daemon = True
    if timeout_s is not None:
        timer.start()
    try:
        yield
    except (RuntimeError, OSError) as error:
        what = f"not ready within {allowed_s:g} s" if late else str(error).splitlines()[0]
        raise LostWorkerError(f"the workers could not be started: {what}") from (None if late else error)
    finally:
        timer.cancel()


def next_of(coming: SimpleQueue[Any], workers: Workers, timeout_s: float | None) -> Any:
    """Wait for what workers bring, as long as they live.

    Args:
        coming: batches, or the error that ended the collecting.
        workers: who bring them.
        timeout_s: who has brought nothing for so long is taken to hang; None: nobody is.

    Raises:
        LostWorkerError: if one of them is dead or hangs; then all are ended.
    """
    begun = time.monotonic()
    while timeout_s is None or time.monotonic() < begun + timeout_s:
        try:
            got = coming.get(timeout=POLL_S)
        except Empty:
            got = None
        error = got if isinstance(got, Exception) else None
        if (got is None or error) and (dead := workers.dead(error)):
            workers.kill()
            raise LostWorkerError(", ".join(dead))
        if error:
            raise error
        if got is not None:
            return got
    silent = " and ".join(workers.silent())
    workers.kill()
    who = f"{silent} hangs" if silent else "the workers are too slow"
    raise LostWorkerError(f"{who}: no batch for {timeout_s:g} s (collect.timeout_s)")
