"""Behavioural cloning of a person's instructions, for the environments that they do not instruct."""

from __future__ import annotations

from collections import deque

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from ibe_rl.types import Array

MAX_STEPS = 5_000
"""The newest steps that the clone is fitted on."""
MIN_STEPS = 100
NOTHING_SAID = 2.0
"""Code for silence; instructions are at most 1."""


class ClonedInstructor:
    """Gives the instructions, or silence, that the person gave in similar states.

    A small decision tree, fitted again after each episode: people decide by thresholds such as "too far left", and a
    tree fits between two frames. People react late, and so does their clone.

    Args:
        instruction_size: d.
    """

    def __init__(self, instruction_size: int):
        self._instructions: list[Array] = []  # instruction of each class of the tree
        self._size, self._episodes = instruction_size, deque[tuple[Array, Array]]()
        self._tree: DecisionTreeClassifier | None = None

    def learn(self, states: Array, instructions: Array, given: Array) -> None:
        """Fit again, with one more episode of the person.

        Args:
            states: ``(T, S)``.
            instructions: ``(T, d)``.
            given: ``(T, 1)``.
        """
        self._episodes.append((states, np.where(given > 0, instructions, NOTHING_SAID)))
        while sum(len(one) for one, _ in self._episodes) - len(self._episodes[0][0]) >= MAX_STEPS:
            self._episodes.popleft()
        seen, said = (np.concatenate(column) for column in zip(*self._episodes, strict=True))
        if len(seen) < MIN_STEPS:
            return
        kinds, classes = np.unique(said, axis=0, return_inverse=True)
        self._instructions = list(kinds)
        tree = DecisionTreeClassifier(max_depth=8, min_samples_leaf=20, random_state=0)
        self._tree = tree.fit(seen, classes.reshape(-1))

    def reset(self, rows: Array) -> None:
        """Nothing to forget."""

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``; silent before ``MIN_STEPS`` steps."""
        if self._tree is None:
            return np.zeros((len(states), self._size), np.float32), np.zeros((len(rows), 1), np.float32)
        said = np.array(self._instructions, np.float32)[self._tree.predict(states)]
        silent = (said == NOTHING_SAID).any(axis=1, keepdims=True)
        return np.where(silent, 0.0, said).astype(np.float32), (~silent).astype(np.float32)
