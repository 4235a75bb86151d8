"""Times are right also if the system's clock is set back."""

import time

import pytest
from torchrl import timeit

from ibe_rl.runtime.stopwatch import Stopwatch


def test_a_clock_that_is_set_back_changes_no_duration(monkeypatch: pytest.MonkeyPatch) -> None:
    system, steady = iter([5000.0, 1400.0]), iter([10.0, 12.5])
    Stopwatch.erase()
    with monkeypatch.context() as patch:
        patch.setattr(time, "time", lambda: next(system))
        patch.setattr(time, "monotonic", lambda: next(steady))
        with Stopwatch("work"):
            pass
    assert Stopwatch.todict(percall=False) == timeit.todict(percall=False) == {"work": 2.5}
    Stopwatch.erase()
