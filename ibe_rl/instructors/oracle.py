"""The instructor that follows the environment's rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.envs.worded import has_rule
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError


def check_words(who: str, task: Task) -> None:
    """Refuse the rule as an instructor with words that it cannot say.

    Raises:
        ConfigError: naming them and what is allowed.
    """
    if task.words is not None and not has_rule(task):
        raise ConfigError(
            f"{who} with instructor.words={list(task.words.names)}: the rule of {task.name} cannot say them; allowed "
            "are as many words as values that it gives, or another instructor"
        )


class Oracle:
    """Gives the rule's instruction at every step."""

    kind = "oracle"

    def __init__(self, rule: Callable[[Array], Array], of_words: bool = False):
        self._rule, self._of_words = rule, of_words

    @classmethod
    def make(cls, _: Any, task: Task, seed: int) -> Self:  # noqa: ARG003 - it draws nothing
        """See ``ibe_rl.instructors``."""
        return cls(task.rule, task.words is not None)

    @staticmethod
    def check(config: InstructorConfig, collect: CollectConfig, task: Task) -> None:  # noqa: ARG004 - of all instructors
        """Refuse words that the environment's rule cannot say.

        Raises:
            ConfigError: naming them and what is allowed.
        """
        check_words(f"instructor={config.kind}", task)

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``; where the rule gives words, none of them is silence."""
        said = self._rule(states)
        if self._of_words:
            given: Array = said.max(axis=1, keepdims=True) > 0
            return said, given.astype(np.float32)
        return said, np.ones((len(rows), 1), np.float32)
