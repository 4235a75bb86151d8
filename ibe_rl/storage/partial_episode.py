"""The unfinished episodes of a resumed run."""

from __future__ import annotations

from dataclasses import dataclass

from ibe_rl.types import Array


@dataclass(frozen=True)
class PartialEpisode:
    """An unfinished episode, from which the environment can be restored by replaying its actions.

    Attributes:
        ended: earlier episodes of the environment.
        actions: ``(t,)`` or ``(t, A)`` actions so far.
        state: ``(S,)`` that these actions led to; None if a new episode begins.
    """

    ended: int
    actions: Array
    state: Array | None
