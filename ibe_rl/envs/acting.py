"""Acting in several episodes at once: policies that remember, or ask the environment for its masks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from ibe_rl.types import Array, Policy


class PolicyWithMemory(Protocol):
    """A policy that also reads what it remembers of each episode, and may ask the environments."""

    def __call__(self, observations: Array) -> Array:
        """As ``ibe_rl.types.Policy``, in episodes that begin here."""

    def act_with_memory(
        self, observations: Array, memories: Sequence[Any], envs: Sequence[Any] | None
    ) -> tuple[Array, Sequence[Any]]:
        """Act once in each of ``N`` episodes.

        Args:
            observations: ``(N, O)``.
            memories: ``N``, each from its last step; None at the beginning of an episode.
            envs: ``N`` environments in these states; None where a learned predictor has none.

        Returns:
            actions ``(N,)`` or ``(N, A)``, and the memories after them.
        """


class Acting:
    """A policy in several episodes at once, with a memory of each.

    Args:
        policy: any ``Policy``; one with ``act_with_memory`` is a ``PolicyWithMemory``.
        memories: one for each episode.

    Attributes:
        memories: before the next action.
    """

    def __init__(self, policy: Policy, memories: Iterable[Any]):
        self._policy, self._remembering = policy, getattr(policy, "act_with_memory", None)
        self.memories: list[Any] = list(memories)

    def __call__(self, observations: Array, rows: Sequence[int], envs: Sequence[Any] | None) -> Array:
        """Act in the episodes ``rows``, with an observation of each; ``envs`` are those of all episodes."""
        if self._remembering is None:
            return self._policy(observations)
        there = None if envs is None else [envs[row] for row in rows]
        actions: Array
        actions, memories = self._remembering(observations, [self.memories[row] for row in rows], there)
        for row, memory in zip(rows, memories, strict=True):
            self.memories[row] = memory
        return actions
