"""An instructor with the flaws of a person: sometimes wrong, late or absent, and slow to let go of a key."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.instructors.oracle import Oracle
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode, Instructor


@dataclass
class FlawedConfig(InstructorConfig):
    """The oracle with the flaws of a person; whether it is wrong or absent is drawn for each spell of steps."""

    kind: str = "flawed"
    wrong: float = setting(0.0, low=0.0, high=1.0)  # share of spells with another value than the right one
    late_steps: int = setting(0, low=0, high=1_000)  # delay of the instruction; silent until then
    lasting_steps: int = setting(0, low=0, high=1_000)  # for which a number is still said when it should be 0 again
    present: float = setting(1.0, low=0.0, high=1.0)  # share of spells with any instruction
    spell_steps: int = setting(25, low=1)  # 1: drawn at every step


class Flawed:
    """Another instructor with flaws.

    An episode is divided into spells of ``spell_steps``. For each spell of each agent it is drawn whether the
    instructor is absent, and whether it is wrong. A wrong one permutes the values, in the same way for the whole spell.

    Args:
        inner: gives the right instruction.
        values: of each number, rising.
        config: rates and delay.
        seed: of all draws.
        words: how many words there are, where instructions are words; a wrong one is another word. 0: numbers.
    """

    kind, settings = "flawed", FlawedConfig

    def __init__(self, inner: Instructor, values: Sequence[float], config: FlawedConfig, seed: int, words: int = 0):
        self._inner, self._values, self._config = inner, np.array(values, np.float32), config
        self._words = words
        self._random = np.random.default_rng([seed, 0xF1A])
        self._age = np.zeros(0, np.int64)  # steps of each agent's episode so far
        self._history: Array | None = None  # (N, late + 1, d + 1): ring buffer of right instructions

    @classmethod
    def make(cls, config: FlawedConfig, task: Task, seed: int) -> Self:
        """See ``ibe_rl.instructors``."""
        words = 0 if task.words is None else len(task.words.names)
        return cls(Oracle(task.rule, words > 0), task.instruction_values, config, seed, words)

    @staticmethod
    def check(config: FlawedConfig, collect: CollectConfig, task: Task) -> None:
        """Refuse words that the rule cannot say, or that would last beside the next ones.

        Raises:
            ConfigError: naming the key, the value and what is allowed.
        """
        Oracle.check(config, collect, task)
        if task.words is not None and config.lasting_steps:
            raise ConfigError(f"instructor.lasting_steps={config.lasting_steps}: allowed is 0 with instructor.words")

    def reset(self, rows: Array) -> None:
        """Clear these rows, and begin a spell."""
        self._inner.reset(rows)
        if len(rows) != len(self._age):
            self._age, self._history = np.zeros(len(rows), np.int64), None
            self._held, self._left = np.zeros((2, len(rows), 1))
            self._absent, self._shift = np.zeros(len(rows), bool), np.zeros(len(rows), np.int64)
        self._age[rows] = 0
        self._left[rows] = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        right = np.concatenate(self._inner.instruct(states, rows), axis=1)
        right[:, :-1] = self._lasting(right[:, :-1], rows)
        self._draw_spells(rows & (self._age % self._config.spell_steps == 0))
        said = self._delayed(right, rows)
        self._age[rows] += 1
        given = said[:, -1:] * ~self._absent[:, None]
        return (self._with_errors(said[:, :-1]) * given).astype(np.float32), given.astype(np.float32)

    def _draw_spells(self, rows: Array) -> None:
        """Draw a new spell for these rows."""
        if not rows.any():
            return
        absent, wrong = self._random.random((2, len(rows)))
        values = max(2, self._words or len(self._values))
        shift = self._random.integers(1, values, len(rows)) * (wrong < self._config.wrong)
        self._absent[rows], self._shift[rows] = (absent >= self._config.present)[rows], shift[rows]

    def _lasting(self, right: Array, rows: Array) -> Array:
        """The right instruction, or the last one that was not 0 for a while longer."""
        if not self._config.lasting_steps:
            return right
        self._held, self._left = (np.broadcast_to(one, right.shape).copy() for one in (self._held, self._left))
        lasts = (right == 0) & (self._left > 0)
        said = np.where(lasts, self._held, right)
        left = np.where(right != 0, self._config.lasting_steps, self._left - lasts)
        self._held[rows], self._left[rows] = said[rows], left[rows]
        return said

    def _delayed(self, right: Array, rows: Array) -> Array:
        """The right instruction ``late_steps`` ago, silence before that."""
        length = self._config.late_steps + 1
        if self._history is None:
            self._history = np.zeros((len(rows), length, right.shape[1]), np.float32)
        every = np.arange(len(rows))
        self._history[every[rows], self._age[rows] % length] = right[rows]
        then = self._history[every, (self._age + 1) % length]
        return np.where((self._age >= self._config.late_steps)[:, None], then, 0.0)

    def _with_errors(self, instruction: Array) -> Array:
        """Replace the values, or the word, in the rows that are wrong now."""
        if self._words:
            others = (instruction.argmax(axis=1) + self._shift) % self._words
            return np.eye(instruction.shape[1], dtype=np.float32)[others]
        places = np.abs(instruction[..., None] - self._values).argmin(axis=-1)
        other = self._values[(places + self._shift[:, None]) % len(self._values)]
        return np.where(self._shift[:, None] > 0, other, instruction)


class _Replayed:
    """Repeats the instructions of episodes, one episode per row."""

    def __init__(self, episodes: Sequence[Episode]):
        steps = max(map(len, episodes))
        size = episodes[0].instructions.shape[1]
        self._said = np.zeros((len(episodes), steps, size + 1), np.float32)
        for row, episode in enumerate(episodes):
            self._said[row, : len(episode)] = np.column_stack([episode.instructions, episode.given])
        self._step = 0

    def reset(self, rows: Array) -> None:
        """Return to the first step."""
        self._step = 0

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``; all rows are at the same step."""
        said = self._said[:, self._step]
        self._step += 1
        return said[:, :-1], said[:, -1:]


def corrupted(
    episodes: Sequence[Episode], values: Sequence[float], flaws: FlawedConfig, seed: int, words: int = 0
) -> list[Episode]:
    """The same episodes with the instructions of a flawed instructor; states and actions stay.

    Args:
        episodes: with the right instructions.
        values: of each number of an instruction.
        flaws: of the instructor.
        seed: of the draws.
        words: see ``Flawed``.
    """
    instructor = Flawed(_Replayed(episodes), values, flaws, seed, words)
    instructor.reset(np.ones(len(episodes), bool))
    lengths, unseen = np.array([len(episode) for episode in episodes]), np.zeros((len(episodes), 0))
    steps = [np.concatenate(instructor.instruct(unseen, step < lengths), axis=1) for step in range(lengths.max())]
    heard = np.stack(steps, axis=1)
    return [
        replace(episode, instructions=heard[row, : len(episode), :-1], given=heard[row, : len(episode), -1] > 0)
        for row, episode in enumerate(episodes)
    ]
