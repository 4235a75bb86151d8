"""Each process of a pool keeps its copy of an object; calls go round between them."""

from __future__ import annotations

import os
from concurrent.futures.process import BrokenProcessPool

import pytest

from ibe_rl.runtime.pool import ProcessPool


class Counting:
    """Counts the calls of this copy."""

    def __init__(self) -> None:
        self.calls = 0

    def add(self, *numbers: int) -> tuple[int, int, int]:
        self.calls += 1
        return sum(numbers), self.calls, os.getpid()

    def die(self) -> None:
        os.kill(os.getpid(), 9)


def test_results_come_in_order_and_each_copy_gets_every_second_call() -> None:
    pool, mine = ProcessPool(Counting(), 2), Counting()
    try:
        sums, calls, processes = zip(*pool.map("add", [(1, 2), (3,), (4, 5), (6,), ()]), strict=True)
        assert sums == (3, 3, 9, 6, 0)
        assert calls == (1, 1, 2, 2, 3)
        assert processes == (*processes[:2], *processes[:2], processes[0])
        assert len({*processes, os.getpid()}) == 3
        assert mine.calls == 0
        with pytest.raises(BrokenProcessPool):
            list(pool.map("die", [()]))
    finally:
        pool.close()
