"""The pace of the environment that a person watches."""

from __future__ import annotations

import time

from ibe_rl.apps.teach.session import TeachingSession

MAX_BEHIND_STEPS = 5
"""An environment that falls behind by more steps does not catch up."""


class Clock:
    """Waits until the next step is due, at the speed that the controls set.

    Args:
        desk: the teaching session, whose controls may change during a wait.
        steps_per_second: in real time.
    """

    def __init__(self, desk: TeachingSession, steps_per_second: float):
        self._desk, self._rate = desk, steps_per_second
        self._at, self._hurry = time.monotonic(), False

    def hurry(self) -> None:
        """Never wait again, not even while paused."""
        with self._desk.changed:
            self._hurry = True
            self._desk.changed.notify_all()

    def wait(self) -> None:
        """Return when the next step is due."""
        with self._desk.changed:
            while not self._hurry:
                left_s = self._left_s(time.monotonic())
                if left_s is not None and left_s <= 0:
                    return
                self._desk.changed.wait(left_s)

    def _left_s(self, now: float) -> float | None:
        """Seconds until the next step, None while paused; marks the step as made if it is due."""
        controls = self._desk.controls
        if controls.paused:
            return None
        step_s = 0.0 if controls.speed is None else 1 / (self._rate * controls.speed)
        due = self._at + step_s
        if now < due:
            return due - now
        self._at = due if now - due < MAX_BEHIND_STEPS * step_s else now
        return 0.0
