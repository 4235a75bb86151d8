"""Calls are made in their order, in a thread that nobody waits for."""

from __future__ import annotations

from threading import Event, current_thread

import pytest
from view_data import eventually

from ibe_rl.apps.loggers.background import Background


def fail() -> None:
    raise OSError("gone")


def test_calls_are_made_in_their_order_in_one_thread() -> None:
    made: list[int] = []
    threads = set()
    background = Background(10)
    for number in range(5):
        background.do(lambda number=number: (made.append(number), threads.add(current_thread())))
    assert background.finish(lambda: made.append(99), timeout_s=60)
    assert made == [0, 1, 2, 3, 4, 99]
    assert len(threads) == 1
    assert current_thread() not in threads


def test_nobody_waits_for_a_call_that_hangs() -> None:
    held, made = Event(), []
    background = Background(2)
    background.do(held.wait)
    assert eventually(background._calls.empty)
    for number in range(5):
        background.do(lambda number=number: made.append(number))
    assert background.left_out == 3
    assert not background.finish(lambda: made.append(99), timeout_s=0.01)
    held.set()
    assert eventually(lambda: made == [0, 1])


def test_the_first_that_fails_is_the_last() -> None:
    background, made = Background(10), []
    background.do(fail)
    background.do(lambda: made.append(1))
    assert eventually(lambda: not background._thread.is_alive())
    with pytest.raises(OSError, match="gone"):
        background.do(lambda: made.append(2))
    with pytest.raises(OSError, match="gone"):
        background.finish(lambda: made.append(3), timeout_s=60)
    assert made == []


def test_the_last_call_may_fail_too() -> None:
    with pytest.raises(OSError, match="gone"):
        Background(10).finish(fail, timeout_s=60)
