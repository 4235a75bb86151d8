"""Fixed windows and observations that drift is measured on at every refresh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delta import cut_windows
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import write_atomically
from ibe_rl.types import Array, observe
from ibe_rl.vocabulary.settled_horizon import horizon_of

PROBE_EPISODES, PROBE_WINDOWS = 300, 4_000
PROBE_NUMBERS = 4_000_000
"""Most numbers of all its observations together."""


@dataclass(frozen=True)
class Probe:
    """Fixed windows and observations that drift is measured on at every refresh.

    Attributes:
        delta: ``(P, S)`` changes of the state, for vocabulary drift.
        observations: ``(P, O)`` at the beginning of these, or of the first of them, for policy drift.
    """

    delta: Array
    observations: Array

    def save(self, path: Path) -> None:
        """Write both as ``.npz``, without pickle."""
        write_atomically(path, lambda stream: np.savez(stream, delta=self.delta, observations=self.observations))


def draw_probe(log: TrajectoryLog, config: MappingConfig, seed: int) -> Probe:
    """Draw windows and their first observations from whole episodes, good and bad."""
    random = np.random.default_rng(seed)
    steps = horizon_of(config)
    shortest = steps if config.window_end == "drop" else 1  # episode that a window fits into
    long_enough = np.flatnonzero(log.index["steps"] >= shortest)
    drawn = random.permutation(long_enough)[:PROBE_EPISODES]
    episodes = log.read(drawn)
    windows = cut_windows(episodes, steps, config.window_end)
    rows = random.permutation(len(windows))[:PROBE_WINDOWS]
    places = [(episodes[windows.episode[row]], int(windows.step[row])) for row in rows]
    instructions = np.array([episode.instructions[step] for episode, step in places])
    given = np.array([[episode.given[step]] for episode, step in places])
    percepts = log.percepts_at(drawn[windows.episode[rows]], windows.step[rows], PROBE_NUMBERS)
    return Probe(windows.delta[rows], observe(percepts, instructions[: len(percepts)], given[: len(percepts)]))
