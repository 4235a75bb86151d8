"""The pace of the game: real time, other speeds, paused, and in a hurry."""

import threading
from types import SimpleNamespace

import pytest

from ibe_rl.apps.teach import clock as clock_module
from ibe_rl.apps.teach.clock import MAX_BEHIND_STEPS, Clock
from ibe_rl.apps.teach.messages import Pause, Speed
from ibe_rl.apps.teach.session import TeachingSession

ANN = 1
RATE = 50.0


class Time:
    """A clock on the wall that only goes when it is set, or while somebody waits."""

    def __init__(self, desk: TeachingSession, monkeypatch: pytest.MonkeyPatch):
        self.now = 100.0
        monkeypatch.setattr(clock_module, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(desk.changed, "wait", self._wait)

    def _wait(self, seconds: float | None) -> None:
        assert seconds is not None, "it would wait for ever"
        self.now += seconds


def steps(clock: Clock, time: Time, count: int, busy_s: float = 0.0) -> list[float]:
    """When each of so many steps is made, with so much to do after each."""
    made = []
    for _ in range(count):
        clock.wait()
        made.append(time.now - 100.0)
        time.now += busy_s
    return made


@pytest.mark.parametrize("speed", [0.25, 1.0, 4.0])
def test_steps_follow_the_speed(speed: float, monkeypatch: pytest.MonkeyPatch):
    desk = TeachingSession((-1.0, 1.0), 0, speed)
    time = Time(desk, monkeypatch)
    made = steps(Clock(desk, RATE), time, 5, busy_s=0.004 / speed)
    assert made == pytest.approx([step / (RATE * speed) for step in range(1, 6)])


def test_unthrottled_nothing_is_waited_for(monkeypatch: pytest.MonkeyPatch):
    desk = TeachingSession((-1.0, 1.0), 0, None)
    time = Time(desk, monkeypatch)
    assert steps(Clock(desk, RATE), time, 3, busy_s=0.001) == pytest.approx([0, 0.001, 0.002])


def test_a_little_late_is_made_up_for_and_a_lot_is_not(monkeypatch: pytest.MonkeyPatch):
    desk = TeachingSession((-1.0, 1.0), 0, 1.0)
    time = Time(desk, monkeypatch)
    clock = Clock(desk, RATE)
    time.now += 0.05  # two and a half steps
    assert steps(clock, time, 4) == pytest.approx([0.05, 0.05, 0.06, 0.08])
    time.now += (MAX_BEHIND_STEPS + 2) / RATE
    late = time.now - 100.0
    assert steps(clock, time, 3) == pytest.approx([late, late + 0.02, late + 0.04])


def waiting(clock: Clock) -> threading.Event:
    """Wait for a step in a thread; set when it is made."""
    made = threading.Event()
    threading.Thread(target=lambda: (clock.wait(), made.set()), daemon=True).start()
    return made


@pytest.fixture
def paused() -> TeachingSession:
    desk = TeachingSession((-1.0, 1.0), 0, 1.0)
    desk.join(ANN)
    desk.hear(ANN, Pause(True))
    return desk


def test_a_paused_game_waits_until_it_goes_on(paused: TeachingSession):
    made = waiting(Clock(paused, RATE))
    assert not made.wait(0.2)
    paused.hear(ANN, Pause(False))
    assert made.wait(60)


def test_a_paused_game_goes_on_when_its_page_goes(paused: TeachingSession):
    made = waiting(Clock(paused, RATE))
    assert not made.wait(0.1)
    paused.leave(ANN)
    assert made.wait(60)


def test_in_a_hurry_a_paused_game_goes_on_too(paused: TeachingSession):
    clock = Clock(paused, RATE)
    made = waiting(clock)
    assert not made.wait(0.1)
    clock.hurry()
    assert made.wait(60)
    clock.wait()


def test_a_new_speed_counts_at_once():
    desk = TeachingSession((-1.0, 1.0), 0, 0.005)
    desk.join(ANN)
    made = waiting(Clock(desk, 0.5))  # a step in 400 seconds
    assert not made.wait(0.1)
    desk.hear(ANN, Speed(None))
    assert made.wait(60)
