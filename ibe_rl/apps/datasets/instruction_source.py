"""What the instructor said in a recorded episode: from its infos, its observations or the environment's rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ibe_rl.ibe.vocabulary import phrase
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError

INSTRUCTION, GIVEN, RULE = "instruction", "instruction_given", "rule"
_SILENCE = ("", "none", "null")
"""Words for no instruction."""


def instructed_size(task: Task) -> int:
    """Numbers of a state with an instruction and whether it was given."""
    return len(task.state_names) + task.instruction_size + 1


@dataclass(frozen=True)
class InstructionSource:
    """Where the instruction of all episodes of a data set is from.

    Attributes:
        task: of the environment.
        source: a key of the infos, "rule", or None for the end of the observations.
        asked: whether the user named it.
    """

    task: Task
    source: str | None
    asked: bool = False

    @classmethod
    def found(cls, task: Task, key: str | None, first: Any, whole: bool) -> InstructionSource:
        """Choose the source by the first episode.

        Args:
            task: of the environment.
            key: that the user named; None: ``instruction`` of the infos, else the observations, else the rule.
            first: the first episode, a ``RawEpisode``.
            whole: whether the observations may end with the instruction.

        Raises:
            ConfigError: if there is no such key.
        """
        if key == RULE or (key is not None and key in first.infos):
            return cls(task, key, asked=True)
        if key is not None:
            raise ConfigError(
                f"instruction={key}: allowed are {', '.join(first.infos) or 'no keys'} of its infos, or {RULE}"
            )
        if INSTRUCTION in first.infos:
            return cls(task, INSTRUCTION)
        shape = np.shape(first.observations) if whole and not isinstance(first.observations, Mapping | tuple) else ()
        return cls(task, None if shape[1:] == (instructed_size(task),) else RULE)

    def of(self, recorded: Any, rows: Array, steps: int) -> tuple[Array, Array]:
        """Instructions ``(T, d)`` float32 and whether they were given ``(T,)``.

        Args:
            recorded: the episode.
            rows: its states ``(T + 1, S)``, or observations ``(T + 1, O)``.
            steps: T.

        Raises:
            ConfigError: if the episode has no instruction there, or none that can be read.
        """
        if not self.asked and self.source != INSTRUCTION and INSTRUCTION in recorded.infos:
            raise recorded.refuse(f"it has infos[{INSTRUCTION!r}] and the first episode has none", _ONE_INSTRUCTOR)
        if self.source == RULE:
            said = self.task.rule(rows[:-1, : len(self.task.state_names)].copy()).astype(np.float32)
            return said, np.ones(steps, bool)
        if self.source is None:
            return rows[:-1, len(self.task.state_names) : -1], rows[:-1, -1] > 0
        if self.source not in recorded.infos:
            raise recorded.refuse(f"it has no infos[{self.source!r}], as the first episode has", _ONE_INSTRUCTOR)
        return self._heard(recorded, self.source, steps)

    def _heard(self, recorded: Any, key: str, steps: int) -> tuple[Array, Array]:
        found = np.asarray(recorded.infos[key])
        silent = np.zeros(len(found), bool)
        if found.dtype.kind in "SUO":
            found, silent = self._read(recorded, key, found.reshape(-1).tolist())
        if found.dtype.kind not in "biuf":
            raise recorded.refuse(f"infos[{key!r}] is of type {found.dtype}", "are numbers or words")
        said = found.reshape(len(found), -1).astype(np.float32) if len(found) else found
        if said.shape not in ((steps, self.task.instruction_size), (steps + 1, self.task.instruction_size)):
            raise recorded.refuse(
                f"infos[{key!r}] has the shape {said.shape} in an episode of {steps} steps",
                f"is {(steps, self.task.instruction_size)}, or a row more",
            )
        if not np.all(np.abs(said[:steps]) <= 1):  # neither does one that is no number
            raise recorded.refuse(
                f"infos[{key!r}] ranges from {said.min():g} to {said.max():g}", "are numbers from -1 to 1"
            )
        return said[:steps], self._given(recorded, steps) & ~silent[:steps]

    def _given(self, recorded: Any, steps: int) -> Array:
        if GIVEN not in recorded.infos:
            return np.ones(steps, bool)
        given = np.asarray(recorded.infos[GIVEN]).reshape(-1)
        if len(given) not in (steps, steps + 1) or given.dtype.kind not in "biuf":
            raise recorded.refuse(
                f"infos[{GIVEN!r}] has {len(given)} values of type {given.dtype}", f"are {steps} bools"
            )
        return given[:steps].astype(bool)

    def _read(self, recorded: Any, key: str, words: Sequence[Any]) -> tuple[Array, Array]:
        """The values ``(T, d)`` of words, and where nothing was said."""
        known = values_of_words(self.task)
        plain = [(word.decode() if isinstance(word, bytes) else str(word)).strip().lower() for word in words]
        nothing = np.array([word in _SILENCE for word in plain], bool)
        for step, word in enumerate(plain):
            if word not in known and word not in _SILENCE:
                raise recorded.refuse(f"infos[{key!r}] of step {step} is {word!r:.80}", f"are {', '.join(known)}")
        zero = (0.0,) * self.task.instruction_size
        return np.array([known.get(word, zero) for word in plain], np.float32), nothing


def values_of_words(task: Task) -> dict[str, tuple[float, ...]]:
    """The task's words, in small letters, to the instruction that each stands for."""
    if task.words is not None:
        return {word.lower(): tuple(task.words.one_hot(slot).tolist()) for slot, word in enumerate(task.words.names)}
    values = product(sorted(task.instruction_values, key=abs), repeat=task.instruction_size)
    return {phrase(np.array(value), task.phrases).lower(): value for value in values}


_ONE_INSTRUCTOR = (
    f"is the same instructor in all episodes: --instruction {RULE} asks the environment's rule in each state"
)
