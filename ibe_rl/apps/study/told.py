"""Episodes that go on otherwise: at the last frame that is seen, the agent is told something else for good."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.apps.study.stimuli import CutEpisode
from ibe_rl.collect.rollout import record_rollout
from ibe_rl.explain.what_if import values_of
from ibe_rl.task import Task
from ibe_rl.types import Array, Instructor, Policy


class ToldFrom:
    """Instructs as somebody else does, and from a step of a single episode on says one value."""

    def __init__(self, instructor: Instructor, step: int, value: Array):
        self._instructor, self._from, self._value, self._step = instructor, step, value, 0

    def reset(self, rows: Array) -> None:
        """See ``ibe_rl.types.Instructor``."""
        self._step = 0
        self._instructor.reset(rows)

    def instruct(self, states: Array, rows: Array) -> tuple[Array, Array]:
        """See ``ibe_rl.types.Instructor``."""
        instruction, given = self._instructor.instruct(states, rows)
        self._step += 1
        if self._step <= self._from:
            return instruction, given
        return np.broadcast_to(self._value, instruction.shape), np.ones_like(given)


def told_otherwise(
    found: Iterator[CutEpisode], env: gymnasium.Env[Any, Any], task: Task, policy: Policy, instructor: Instructor
) -> Iterator[CutEpisode]:
    """Fly cut episodes again with the same seeds, told another value than before at the last frame that is seen.

    What it is told is drawn by lot. Those that then end before the step that people are asked about are left out.
    """
    for one in found:
        name, value = _another(one, task)
        watched = record_rollout(env, policy, ToldFrom(instructor, one.last, value), one.seed)
        if len(watched.episode) >= one.end:
            yield replace(one, watched=watched, told=name)


def _another(one: CutEpisode, task: Task) -> tuple[str, Array]:
    """One of the values that it was not being told."""
    before = one.watched.moments[one.last]
    others = [
        (name, value)
        for name, value in values_of(task).items()
        if not (before.given and np.array_equal(before.instruction, value))
    ]
    return others[np.random.default_rng(one.seed).integers(len(others))]
