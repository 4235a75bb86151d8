"""The unfinished episodes of a resumed run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

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

    @classmethod
    def of(cls, parts: Sequence[Mapping[str, Array]], ended: int) -> Self:
        """Of its logged steps, in parts of columns ``(t, ...)``; see ``TrajectoryLog.add``."""
        if not parts:
            return cls(ended, np.zeros(0, np.int64), None)
        return cls(ended, np.concatenate([part["action"] for part in parts]), parts[-1]["next_state"][-1])
