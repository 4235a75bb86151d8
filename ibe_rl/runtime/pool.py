"""Processes, each with a copy of one object whose methods it calls."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from itertools import cycle
from typing import Any

import cloudpickle
from threadpoolctl import threadpool_limits

from ibe_rl.runtime.signals import interrupts_stay_here, script_stays_here
from ibe_rl.runtime.workers import end_with_parent, process_context


class ProcessPool:
    """Processes that start at the first call, ignore Ctrl-C and end with this process.

    Args:
        kept: copied to each process, so cloudpickle has to be able to pickle it.
        processes: how many.
    """

    def __init__(self, kept: Any, processes: int) -> None:
        context, sent = process_context(), cloudpickle.dumps(kept)
        self._workers = [ProcessPoolExecutor(1, context, _keep, (sent,)) for _ in range(processes)]

    def map(self, method: str, calls: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Call a method of the kept object with the arguments of each call; results keep their order.

        Calls are assigned to processes in a fixed order, so that results are reproducible.

        Raises:
            BrokenProcessPool: if a process was killed.
        """
        with interrupts_stay_here(), script_stays_here():
            pairs = zip(cycle(self._workers), calls, strict=False)
            results = [worker.submit(_call, method, arguments) for worker, arguments in pairs]
        return (result.result() for result in results)

    def each(self, method: str) -> None:
        """Call a method of the kept object in every process, before the calls to come; nobody waits for it.

        Raises:
            BrokenProcessPool: if a process was killed.
        """
        with interrupts_stay_here(), script_stays_here():
            for worker in self._workers:
                worker.submit(_call, method, ())

    def close(self) -> None:
        """Stop the processes; pending calls are dropped."""
        for worker in self._workers:
            worker.shutdown(cancel_futures=True)


def _can_be_copied(kept: Any) -> bool:
    try:
        cloudpickle.dumps(kept)
    except Exception:  # pickling may raise anything
        return False
    return True


def call_each(kept: Any, method: str, calls: Sequence[tuple[Any, ...]], processes: int) -> Iterator[Any]:
    """Call a method of an object with the arguments of each call, in so many processes; 1: this one.

    What cannot be copied to others is called in this one, as is what a killed process has left undone.
    """
    done = 0
    if processes > 1 and _can_be_copied(kept):
        with closing(ProcessPool(kept, processes)) as pool:
            try:
                for result in pool.map(method, calls):
                    done += 1
                    yield result
            except BrokenProcessPool:
                pass
    for arguments in calls[done:]:
        yield getattr(kept, method)(*arguments)


_kept: list[Any] = []
"""The copy of the kept object in a pool process."""


def _keep(sent: bytes) -> None:
    threadpool_limits(1)
    end_with_parent()
    _kept[:] = [cloudpickle.loads(sent)]


def _call(method: str, arguments: tuple[Any, ...]) -> Any:
    return getattr(_kept[0], method)(*arguments)
