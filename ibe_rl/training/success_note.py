"""Says if the key in ``info`` that reports success never comes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ibe_rl.config.limits import nearest
from ibe_rl.envs.gate import gate_of
from ibe_rl.vocabulary.listener import Listener


class SuccessNote(Listener):
    """Looks at the environments of the first evaluation, whose episodes were whole."""

    def __init__(self) -> None:
        self._told: list[str] | None = None

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        self._run = run

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """See ``Listener``."""
        if self._told is not None:
            return
        self._told = []
        gates = [gate for env in self._run.evaluation_envs if (gate := gate_of(env))]
        if gates and all(gate.never_succeeds() for gate in gates):
            key, seen = self._run.task.success_key, sorted(set().union(*(gate.keys_seen for gate in gates)))
            had = f"its keys were {', '.join(seen)}{nearest(key, seen)}" if seen else "it had no keys at all"
            self._told = [f"no info of the evaluation had the success key {key!r}, so no episode succeeds; {had}"]
            self._run.notes.extend(self._told)

    def news(self) -> Iterable[str]:
        """See ``Listener``."""
        said, self._told = self._told, [] if self._told is not None else None
        return [f"note: {line}" for line in said or []]
