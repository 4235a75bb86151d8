"""The functions of a task: called with copies, their answers checked at every call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ibe_rl.envs.conversions import REAL_KINDS, as_flag, as_number, shortened
from ibe_rl.envs.errors import GateError, user_error
from ibe_rl.task import Task
from ibe_rl.types import Array

SAME_VALUE = 1e-6
"""Largest distance of an instruction from a declared value."""
MOST_TRIED = 1_000
"""States that are tried one by one to find the one that a function fails for."""
Check = Callable[["TaskFunction", Any, Array], Any]
"""Of a function, its answer and the states that it was asked for: to the answer, or GateError."""


@dataclass(frozen=True)
class TaskFunction:
    """A user's function of states.

    Attributes:
        function: states, and perhaps more, to an answer.
        label: how it was declared, as ``env.task.rule=rules:mine``.
        check: checks the answer.
        task: whose function it is.
    """

    function: Callable[..., Any]
    label: str
    check: Check
    task: Task

    def __call__(self, states: Array, *rest: Any) -> Any:
        """Ask it.

        Raises:
            GateError: if it raises, or its answer cannot be used; with the state.
        """
        try:
            answer = self.function(np.array(states), *rest)  # a copy, which it may change
        except Exception as error:
            raise GateError(f"{self.label}: it raised {user_error(error)}", self._failing(states, rest)) from None
        return self.check(self, answer, states)

    def _failing(self, states: Array, rest: tuple[Any, ...]) -> Array:
        """The first state ``(S,)`` for which it raises alone; else the first."""
        each = np.atleast_2d(states).reshape(-1, np.shape(states)[-1])
        for state in each[:MOST_TRIED]:
            try:
                self.function(np.array(state[None] if np.ndim(states) > 1 else state), *rest)
            except Exception:
                return np.array(state)
        return np.array(each[0])

    def refused(self, answer: Any, allowed: str, state: Array) -> GateError:
        """The error for an answer that cannot be used, in the state ``(S,)``."""
        found = f"it returned {shortened(answer)} for the state {np.asarray(state).tolist()}"
        return GateError(f"{self.label}: {found}; allowed is {allowed}", np.array(state))


def _array(asked: TaskFunction, answer: Any, states: Array, size: int) -> Array:
    """The answer as numbers ``(..., size)`` for states ``(..., S)``."""
    given, first = np.asarray(answer), np.atleast_2d(states).reshape(-1, np.shape(states)[-1])[0]
    shape = (*np.shape(states)[:-1], size)
    if given.dtype.kind not in REAL_KINDS:
        raise asked.refused(answer, "numbers", first)
    if given.shape != shape:
        raise GateError(
            f"{asked.label}: for {np.shape(states)[0] if len(shape) > 1 else 1} states it gave an array of shape "
            f"{given.shape}; allowed is {shape}",
            np.array(first),
        )
    return given


def _worst(wrong: Array, answer: Array, states: Array) -> tuple[Array, Array]:
    """The first wrong answer ``(d,)`` and its state ``(S,)``."""
    row = int(np.flatnonzero(wrong.reshape(-1, wrong.shape[-1]).any(axis=-1))[0])
    return answer.reshape(-1, answer.shape[-1])[row], states.reshape(-1, states.shape[-1])[row]


def _instructions(asked: TaskFunction, answer: Any, states: Array) -> Array:
    said = _array(asked, answer, states, asked.task.instruction_size)
    values = asked.task.instruction_values
    if set(said.ravel().tolist()) <= set(values):  # nearly always, and much faster than the next line
        return said
    near = np.abs(said[..., None] - np.asarray(values)).min(axis=-1) <= SAME_VALUE  # false for NaN
    if not near.all():
        wrong, state = _worst(~near, said, states)
        allowed = f"{', '.join(f'{value:g}' for value in values)} (instruction_values)"
        raise asked.refused(wrong.tolist(), allowed, state)
    return said


def _changes(asked: TaskFunction, answer: Any, states: Array) -> Array:
    return _finite(asked, _array(asked, answer, states, len(asked.task.explained)), states)


def _points(asked: TaskFunction, answer: Any, states: Array) -> Array:
    return _finite(asked, _array(asked, answer, states, 2), states)


def _finite(asked: TaskFunction, given: Array, states: Array) -> Array:
    finite = np.isfinite(given)
    if not finite.all():
        wrong, state = _worst(~finite, given, states)
        raise asked.refused(wrong.tolist(), "finite numbers", state)
    return given


def _context(asked: TaskFunction, answer: Any, state: Array) -> str:
    if not isinstance(answer, str) or answer not in asked.task.contexts:
        raise asked.refused(answer, f"one of {', '.join(asked.task.contexts)}", state)
    return answer


def _contact(asked: TaskFunction, answer: Any, states: Array) -> int:
    number = as_number(answer)
    if number is None or number != int(number) or not 0 <= number < len(states):
        raise asked.refused(answer, f"a step from 0 to {len(states) - 1}", states[0])
    return int(number)


def _success(asked: TaskFunction, answer: Any, state: Array) -> bool:
    flag = as_flag(answer)
    if flag is None:
        raise asked.refused(answer, "True or False", state)
    return flag


CHECKS: Mapping[str, Check] = {
    "rule": _instructions,
    "motion": _changes,
    "goal_offset": _changes,
    "scene_path": _points,
    "first_contact": _contact,
    "context": _context,
}
"""The functions of a task, and what checks their answers."""


def with_checks(task: Task, named: Mapping[str, str], key: str) -> Task:
    """The task with its functions checked at every call.

    Args:
        task: as declared.
        named: how functions are called in messages; those missing here by their own name.
        key: where they are declared: ``env.task`` or ``task``.
    """
    checked: dict[str, Any] = {
        part: TaskFunction(function, f"{key}.{part}={named.get(part) or name_of(function)}", check, task)
        for part, check in CHECKS.items()
        if (function := getattr(task, part)) is not None and not isinstance(function, TaskFunction)
    }
    return replace(task, **checked)


def checked_success(function: Callable[..., Any] | None, name: str | None, task: Task) -> TaskFunction | None:
    """A declared success function, checked at every call; None if there is none."""
    return None if function is None else TaskFunction(function, f"env.task.success={name}", _success, task)


def name_of(given: Any) -> str:
    """``module.name`` of a function, or of the class of an object."""
    while hasattr(given, "func"):  # functools.partial
        given = given.func
    named = given if hasattr(given, "__qualname__") else type(given)
    return f"{named.__module__}.{named.__qualname__}"
