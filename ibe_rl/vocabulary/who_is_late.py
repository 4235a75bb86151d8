"""How late each of those who instruct a run is."""

from __future__ import annotations

from collections.abc import Mapping

from ibe_rl.ibe.delay import Delay

Delays = Mapping[str, Delay]
"""How late each of those who instruct is, by ``TEACHER`` and ``INSTRUCTOR``; nobody who never said anything."""
TEACHER, INSTRUCTOR = "person", "instructor"
"""Who teaches in a browser, or taught in the session that is replayed; and whoever instructs all the others."""


def of_first(delays: Delays) -> Delay | None:
    """The delay of the person if one teaches, else of whoever instructs; None if nobody has said anything."""
    return delays.get(TEACHER) or delays.get(INSTRUCTOR)
