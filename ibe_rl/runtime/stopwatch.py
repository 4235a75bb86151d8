"""TorchRL's timer by a clock that nobody sets: the system's may go back during a training."""

from __future__ import annotations

import time

from torchrl import timeit


class Stopwatch(timeit):
    """See ``torchrl.timeit``, whose register it adds to."""

    def __enter__(self) -> Stopwatch:
        super().__enter__()
        self.t0 = time.monotonic()
        return self

    def elapsed(self) -> float:
        """Seconds since it was started."""
        return time.monotonic() - self.t0
