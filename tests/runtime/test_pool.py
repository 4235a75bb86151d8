"""Each process of a pool keeps its copy of an object; calls go round between them."""

from __future__ import annotations

import os
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from threading import Lock

import pytest

from ibe_rl.runtime.pool import ProcessPool, call_each


class Counting:
    """Counts the calls of this copy."""

    def __init__(self) -> None:
        self.calls = 0

    def add(self, *numbers: int) -> tuple[int, int, int]:
        self.calls += 1
        return sum(numbers), self.calls, os.getpid()

    def double(self, number: int, safe_in: int) -> int:
        if number == 3 and os.getpid() != safe_in:
            self.die()
        return 2 * number

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


def test_what_each_copy_is_told_comes_before_later_calls() -> None:
    with closing(ProcessPool(Counting(), 2)) as pool:
        _, calls, processes = zip(*pool.map("add", [(), ()]), strict=True)
        pool.each("add")
        _, later, same = zip(*pool.map("add", [(), ()]), strict=True)
        assert (calls, later, same) == ((1, 1), (3, 3), processes)
        with pytest.raises(BrokenProcessPool):
            list(pool.map("die", [()]))
        with pytest.raises(BrokenProcessPool):
            pool.each("add")


@pytest.mark.parametrize("processes", [1, 2])
def test_each_call_is_answered_in_order_also_when_a_process_is_killed(processes: int) -> None:
    calls = [(number, os.getpid()) for number in (1, 2, 3, 4, 5)]
    assert list(call_each(Counting(), "double", calls, processes)) == [2, 4, 6, 8, 10]
    assert list(call_each(Counting(), "double", [], processes)) == []
    with closing(ProcessPool(Counting(), 2)) as pool, pytest.raises(BrokenProcessPool):  # a death to live with
        list(pool.map("double", calls))


def test_calls_are_divided_between_processes_that_end_afterwards() -> None:
    answers = list(call_each(Counting(), "add", [(1,), (2,), (3,), (4,)], 2))
    assert [(total, calls) for total, calls, _ in answers] == [(1, 1), (2, 1), (3, 2), (4, 2)]
    processes = {process for *_, process in answers}
    assert len(processes) == 2
    assert os.getpid() not in processes
    for process in processes:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


def test_what_cannot_be_copied_is_called_here() -> None:
    mine = Counting()
    vars(mine)["lock"] = Lock()  # which nothing can pickle
    assert {process for *_, process in call_each(mine, "add", [(1,), (2,)], 2)} == {os.getpid()}
