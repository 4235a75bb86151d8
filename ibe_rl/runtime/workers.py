"""Worker processes of the trainer: none outlives it, and death or hanging is detected in bounded time."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver
from multiprocessing.connection import wait
from multiprocessing.context import BaseContext
from queue import Empty, SimpleQueue
from threading import Thread, Timer
from typing import Any, Protocol

from ibe_rl.runtime.operating_system import process_start_method
from ibe_rl.runtime.signals import interrupts_stay_here, leave_sigterm_to_parent, script_stays_here

POLL_S = 0.2
ANSWER_S = 3.0
"""Seconds an idle worker may take to answer."""
START_S = 60.0
"""Least start-up limit of workers in seconds: they import much."""
PRELOADED = ["ibe_rl.collect.collector", "ibe_rl.runtime.frozen"]
"""Modules that the process imports that workers are copies of, in this order."""
WITHOUT_WORKERS = ("collect.processes=1", "collect.engine=ray")
"""Settings of runs that start no workers on this machine, or start them in another way."""


class LostWorkerError(RuntimeError):
    """A worker has died or hangs; the message names it and what can be done."""


def process_context() -> BaseContext:
    """How processes are started; on Linux as copies of one that has imported ``PRELOADED``."""
    context = multiprocessing.get_context(process_start_method())
    context.set_forkserver_preload(PRELOADED)
    return context


def preload_workers(arguments: Sequence[str] = ()) -> None:
    """Start the process that workers are copies of; it imports ``PRELOADED`` while this one goes on.

    Args:
        arguments: the command line. Nothing is started where it has one of ``WITHOUT_WORKERS``, or an option: after
            --help or --multirun no worker starts here. A run that needs workers all the same calls this again.
    """
    if any(one in WITHOUT_WORKERS or one.startswith("-") for one in arguments):
        return
    copied = process_context().get_start_method() == "forkserver"
    chosen = multiprocessing.get_start_method(allow_none=True)
    if copied and chosen in (None, "spawn"):  # TorchRL chooses spawn; otherwise the program has chosen another way
        with interrupts_stay_here(), script_stays_here(), suppress(OSError):  # starting the workers says what is wrong
            forkserver.ensure_running()


@contextmanager
def start_method_for_torchrl() -> Iterator[None]:
    """Let TorchRL start processes as ``process_context`` does, by the global method, which its import sets to spawn."""
    before, method = multiprocessing.get_start_method(), process_context().get_start_method()
    multiprocessing.set_start_method(method if before == "spawn" else before, force=True)
    try:
        yield
    finally:
        multiprocessing.set_start_method(before, force=True)


def end_with_parent(farewell_s: float = 0.0) -> None:
    """End this child process as soon as its parent is gone, and not before; call it in the child.

    Args:
        farewell_s: seconds before it exits, to report the loss.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        leave_sigterm_to_parent()
        Thread(target=_end_after, args=(parent.sentinel, farewell_s), daemon=True).start()


def _end_after(sentinel: int, farewell_s: float) -> None:
    wait([sentinel])
    time.sleep(farewell_s)
    os._exit(1)


class Workers(Protocol):
    """The worker pool as its consumer sees it."""

    names: list[str]
    """Empty if the trainer itself collects."""

    def dead(self, error: Exception | None = None) -> list[str]:
        """The workers that have ended, and how; ``error`` is what stopped the collection, if anything."""

    def silent(self) -> list[str]:
        """The workers that do not answer; takes up to ``ANSWER_S``."""

    def kill(self) -> None:
        """Kill all workers at once."""


class Processes:
    """The processes of TorchRL's collector.

    Args:
        processes: of ``MultiSyncCollector``; if one dies, TorchRL closes the others.
        pipes: one per process.
    """

    def __init__(self, processes: Sequence[Any] = (), pipes: Sequence[Any] = ()):
        self._processes, self._pipes = list(processes), list(pipes)
        self.names = [f"worker {i} of {len(processes)} (process {one.pid})" for i, one in enumerate(processes)]

    def dead(self, error: Exception | None = None) -> list[str]:
        """See ``Workers``."""
        if error is not None:
            time.sleep(POLL_S)  # exit codes may arrive after the error
        codes = [_exit_code(process) for process in self._processes]
        found = [(code, name) for code, name in zip(codes, self.names, strict=True) if code is not None]
        own = [pair for pair in found if pair[0] != -signal.SIGTERM]  # TorchRL terminates the others with it
        return [f"{name} has ended ({ending(code)})" for code, name in own or found]

    def silent(self) -> list[str]:
        """See ``Workers``."""
        for pipe in self._pipes:
            with suppress(OSError, ValueError):
                pipe.send(("closed", "get_distant_attr"))  # any request that TorchRL's worker answers between batches
        until = time.monotonic() + ANSWER_S
        heard = [_answers(pipe, until) for pipe in self._pipes]
        return [name for name, answered in zip(self.names, heard, strict=True) if not answered]

    def kill(self) -> None:
        """See ``Workers``."""
        kill(self._processes)


def ending(exit_code: int) -> str:
    """How a process ended, from its ``multiprocessing`` exit code."""
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
    """Kill processes, including hung ones, and wait for their end."""
    for process in processes:
        with suppress(ValueError):  # TorchRL has closed it
            process.kill()
            process.join(ANSWER_S)


@contextmanager
def starting(timeout_s: float | None) -> Iterator[None]:
    """Start processes that must be ready by the end of the body.

    Args:
        timeout_s: limit, at least ``START_S``; None disables it.

    Raises:
        LostWorkerError: if one dies, or they were killed for not being ready in time.
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
    except (RuntimeError, OSError, EOFError) as error:
        copied = "the process that they are copies of has ended" if isinstance(error, EOFError) else None
        known = f"not ready within {allowed_s:g} s" if late else copied
        what = known or str(error).splitlines()[0]
        raise LostWorkerError(f"the workers could not be started: {what}") from (None if known else error)
    finally:
        timer.cancel()


def next_of(coming: SimpleQueue[Any], workers: Workers, timeout_s: float | None) -> Any:
    """Wait for the next batch while the workers live.

    Args:
        coming: batches, or the error that stopped the collection.
        workers: the collecting workers.
        timeout_s: seconds without a batch before a worker counts as hung; None disables it.

    Raises:
        LostWorkerError: if a worker is dead or hangs; all are then killed.
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
