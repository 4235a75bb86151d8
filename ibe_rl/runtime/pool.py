"""A pool of processes that each keep a copy of one object and call its methods."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from typing import Any

from threadpoolctl import threadpool_limits

from ibe_rl.runtime.signals import interrupts_stay_here, script_stays_here
from ibe_rl.runtime.workers import end_with_parent


class ProcessPool:
    """Processes that start with the first call; Ctrl-C does not reach them, and they end with this process.

    Args:
        kept: each process gets a copy of it, so it must be picklable.
        processes: how many.
    """

    def __init__(self, kept: Any, processes: int) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._workers = [ProcessPoolExecutor(1, spawn, _keep, (kept,)) for _ in range(processes)]

    def map(self, method: str, calls: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Call a method of the kept object with the arguments of each call; the results come in this order.

        Each call has its process whatever the others take, so that the results are repeatable.

        Raises:
            BrokenProcessPool: if a process has been killed.
        """
        with interrupts_stay_here(), script_stays_here():
            pairs = zip(cycle(self._workers), calls, strict=False)
            results = [worker.submit(_call, method, arguments) for worker, arguments in pairs]
        return (result.result() for result in results)

    def close(self) -> None:
        """Stop the processes; calls that have not begun are dropped."""
        for worker in self._workers:
            worker.shutdown(cancel_futures=True)


_kept: list[Any] = []
"""In a process of a pool: its copy of the kept object."""


def _keep(kept: Any) -> None:
    threadpool_limits(1)
    end_with_parent()
    _kept[:] = [kept]


def _call(method: str, arguments: tuple[Any, ...]) -> Any:
    return getattr(_kept[0], method)(*arguments)
