"""Where the episodes of a run stand that is taken up again."""

from __future__ import annotations

from dataclasses import dataclass

from ibe_rl.types import Array


@dataclass(frozen=True)
class PartialEpisode:
    """Where an environment stands in the middle of an episode, as far as it can be brought there again.

    Attributes:
        ended: episodes that it has played before this one.
        actions: ``(t,)`` or ``(t, A)`` what was done in this one so far.
        state: ``(S,)`` that these actions led to; None if there is nothing to take up and an episode begins.
    """

    ended: int
    actions: Array
    state: Array | None
