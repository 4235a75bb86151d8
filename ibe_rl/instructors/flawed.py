"""An instructor with the flaws of a person: sometimes wrong, late, not always there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode, Instructor


@dataclass
class FlawedConfig(InstructorConfig):
    """The oracle with the flaws of a person; whether it is wrong or away is drawn anew for each spell of time."""

    kind: str = "flawed"
    wrong: float = setting(0.0, low=0.0, high=1.0)  # share of the time in which it says another value
    late_steps: int = setting(0, low=0, high=1_000)  # it says what was right so many steps ago; until then nothing
    present: float = setting(1.0, low=0.0, high=1.0)  # share of the time in which it says anything
    spell_steps: int = setting(25, low=1)  # 1: drawn at every step


class Flawed:
    """Says what another instructor says, with flaws.

    Time goes in spells of ``spell_steps``. For each of them, each agent by itself, it is drawn anew whether the
    instructor is away, and whether it is wrong: then each number is another of the values, the same other one for the
    same right one as long as the spell lasts.

    Args:
        inner: who is right.
        values: that a number can have, rising.
        config: how often and how much.
        seed: of all draws.
    """

    kind, settings = "flawed", FlawedConfig

    def __init__(self, inner: Instructor, values: Sequence[float], config: FlawedConfig, seed: int):
        self._inner, self._values, self._config = inner, np.array(values, np.float32), config
        self._random = np.random.default_rng([seed, 0xF1A])
        self._age = np.zeros(0, np.int64)  # steps that each agent was instructed at in its episode
        self._lines: Array | None = None  # (N, late + 1, d + 1): what was right at its newest steps, in a ring

    @classmethod
    def make(cls, config: FlawedConfig, task: Task, seed: int) -> Self:
        """See ``ibe_rl.instructors``."""
        return cls(Oracle(task.rule), task.instruction_values, config, seed)

    def reset(self, rows: Array) -> None:
        """Forget what was right in these rows, and begin a spell."""
        self._inner.reset(rows)
        if len(rows) != len(self._age):
            self._age, self._lines = np.zeros(len(rows), np.int64), None
            self._away, self._shift = np.zeros(len(rows), bool), np.zeros(len(rows), np.int64)
        self._age[rows] = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        right = np.concatenate(self._inner.instruct(states, rows), axis=1)
        self._turn(rows & (self._age % self._config.spell_steps == 0))
        said = self._delayed(right, rows)
        self._age[rows] += 1
        given = said[:, -1:] * ~self._away[:, None]
        return (self._mistaken(said[:, :-1]) * given).astype(np.float32), given.astype(np.float32)

    def _turn(self, rows: Array) -> None:
        """Draw a new spell for these rows."""
        if not rows.any():
            return
        away, wrong = self._random.random((2, len(rows)))
        shift = self._random.integers(1, len(self._values), len(rows)) * (wrong < self._config.wrong)
        self._away[rows], self._shift[rows] = (away >= self._config.present)[rows], shift[rows]

    def _delayed(self, right: Array, rows: Array) -> Array:
        """What was right ``late_steps`` ago, silence before that."""
        length = self._config.late_steps + 1
        if self._lines is None:
            self._lines = np.zeros((len(rows), length, right.shape[1]), np.float32)
        every = np.arange(len(rows))
        self._lines[every[rows], self._age[rows] % length] = right[rows]
        then = self._lines[every, (self._age + 1) % length]
        return np.where((self._age >= self._config.late_steps)[:, None], then, 0.0)

    def _mistaken(self, instruction: Array) -> Array:
        """Take other values instead, in the rows that are wrong now."""
        places = np.abs(instruction[..., None] - self._values).argmin(axis=-1)
        other = self._values[(places + self._shift[:, None]) % len(self._values)]
        return np.where(self._shift[:, None] > 0, other, instruction)


class _Again:
    """Says once more what was said in episodes, one a row."""

    def __init__(self, episodes: Sequence[Episode]):
        steps = max(map(len, episodes))
        size = episodes[0].instructions.shape[1]
        self._said = np.zeros((len(episodes), steps, size + 1), np.float32)
        for row, episode in enumerate(episodes):
            self._said[row, : len(episode)] = np.column_stack([episode.instructions, episode.given])
        self._step = 0

    def reset(self, rows: Array) -> None:
        """Begin with the first step."""
        self._step = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``; all rows are at the same step."""
        said = self._said[:, self._step]
        self._step += 1
        return said[:, :-1], said[:, -1:]


def corrupted(episodes: Sequence[Episode], values: Sequence[float], flaws: FlawedConfig, seed: int) -> list[Episode]:
    """The same episodes as if a flawed instructor had been heard in them; what the agent did stays.

    Args:
        episodes: with what an instructor said.
        values: that an instruction can have.
        flaws: of the instructor.
        seed: of the draws.
    """
    instructor = Flawed(_Again(episodes), values, flaws, seed)
    instructor.reset(np.ones(len(episodes), bool))
    lengths, unseen = np.array([len(episode) for episode in episodes]), np.zeros((len(episodes), 0))
    said = [np.concatenate(instructor.instruct(unseen, step < lengths), axis=1) for step in range(lengths.max())]
    heard = np.stack(said, axis=1)
    return [
        replace(episode, instructions=heard[row, : len(episode), :-1], given=heard[row, : len(episode), -1] > 0)
        for row, episode in enumerate(episodes)
    ]
