"""What of a long run goes into a recording of bounded size: everything at first, then less and less of it."""

from __future__ import annotations

import math
from collections.abc import Mapping

FOOTER_SHARE = 0.15
"""Of the file, at most: the table of contents that rerun writes at its end."""
STEP_BYTES, REFRESH_BYTES = 800.0, 50_000.0
"""Of an episode's step and of a vocabulary, before the first one was written."""
MARGIN = 1.25
"""How much larger the next one may be."""
GROWTH = 4
"""Whenever half of the remaining room is used, only one of ``GROWTH`` times as many is kept. With 2 each half would
last equally long; with 4 each lasts twice as long as the one before."""
LATER = 2
"""Vocabularies are small: they begin to be thinned out so many halves later."""


class Thinning:
    """Decides what is kept, from what has been used.

    Args:
        max_bytes: of the whole file.
    """

    def __init__(self, max_bytes: int) -> None:
        self._limit = max_bytes * (1 - FOOTER_SHARE)
        self._step, self._refresh, self._episode = STEP_BYTES, REFRESH_BYTES, 0.0
        self.used = 0

    def took(self, size: int, refreshes: int = 0, steps: int = 0) -> None:
        """Learn from what has been written how large the next one may be.

        Args:
            size: of the file, now.
            refreshes: written since the last call.
            steps: of the episode written since.
        """
        new, self.used = MARGIN * (size - self.used), size
        if refreshes:
            self._refresh = max(self._refresh, new / refreshes)
        if steps:
            self._step = max(self._step, new / steps)
            self._episode = max(self._episode, new)

    def state_dict(self) -> dict[str, float]:
        """What has been learnt so far."""
        return {"step": self._step, "refresh": self._refresh, "episode": self._episode, "used": self.used}

    def load_state_dict(self, state: Mapping[str, float]) -> None:
        """The inverse of ``state_dict``."""
        self._step, self._refresh, self._episode = state["step"], state["refresh"], state["episode"]
        self.used = int(state["used"])

    def halves(self) -> int:
        """How often half of the room that was left has been used."""
        room = self._limit - self._for_the_end()
        left = 1 - self.used / room if room > 0 else 0.0
        return int(-math.log2(left)) if left > 2**-60 else 60

    def every(self, small: bool = False) -> int:
        """One of so many is kept; ``small`` is for vocabularies."""
        return GROWTH ** max(0, self.halves() - LATER * small)

    def fits(self, size: float) -> bool:
        """True if ``size`` more bytes leave room for a last vocabulary and episode."""
        return self.used + size + self._for_the_end() <= self._limit

    def fits_at_the_end(self, size: float) -> bool:
        """True if ``size`` more bytes leave room for nothing but the end of the file."""
        return self.used + size <= self._limit

    def refresh_bytes(self) -> float:
        """At most of a vocabulary."""
        return self._refresh

    def episode_bytes(self, steps: int) -> float:
        """At most of an episode."""
        return self._step * steps

    def _for_the_end(self) -> float:
        return self._refresh + self._episode
