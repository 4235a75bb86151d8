"""Errors of an environment or of its task's functions, with the place where they happened."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from sysconfig import get_paths
from traceback import FrameSummary, extract_tb
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.types import Array, ConfigError

OURS = str(Path(__file__).resolve().parent.parent)
LIBRARIES = (OURS, *(get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")))
"""Folders whose code is not the user's."""
LEARNED_ONLY = "allowed is predictor=ensemble or predictor=regression, which learn from the log"


class GateError(ConfigError):
    """What an environment or a function of its task gave or raised cannot be used.

    Attributes:
        state: ``(S,)`` for which a function of the task failed; None if the place is already in the message.
    """

    def __init__(self, message: str, state: Array | None = None):
        super().__init__(message)
        self.state = state


class CopyError(ConfigError):
    """An environment cannot be copied exactly, so its future cannot be simulated.

    Attributes:
        reason: why, without what is allowed.
    """

    def __init__(self, env_id: str, reason: str):
        super().__init__(f"predictor=simulator with env.id={env_id}: {reason}; {LEARNED_ONLY}")
        self.reason = f"{env_id}: {reason}"


def user_error(error: Exception) -> str:
    """Describe an error from the user's code, with the line of their code that it came from."""
    frames = [frame for frame in extract_tb(error.__traceback__) if not frame.filename.startswith(OURS)]
    own = [frame for frame in frames if not frame.filename.startswith((*LIBRARIES, "<"))] or frames
    said = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    return said + (f" ({_line(own[-1])})" if own else "")


def _line(frame: FrameSummary) -> str:
    return f"{frame.filename}, line {frame.lineno}, in {frame.name}"


def place(env: gymnasium.Env[Any, Any]) -> str:
    """Which environment this is, in which episode and at which step."""
    return str(env.get_wrapper_attr("place")()) if env.has_wrapper_attr("place") else f"env={env}"


def check_beginning(env: gymnasium.Env[Any, Any], task: Any, state: Array) -> None:
    """Ask for the context of an episode that begins in ``state`` ``(S,)``.

    Raises:
        GateError: if it is unknown.
    """
    try:
        task.context(state)
    except GateError as error:
        raise GateError(f"{place(env)}: {error}") from None


def located(error: GateError, envs: Sequence[gymnasium.Env[Any, Any]], states: Iterable[Array]) -> GateError:
    """Add the place to an error of a task's function, if ``states`` has the state ``(S,)`` that it failed for.

    Args:
        error: as raised.
        envs: ``N`` environments.
        states: the current state of each.
    """
    for env, state in zip(envs, states, strict=False):
        if error.state is not None and np.array_equal(state, error.state):
            return GateError(f"{place(env)}: {error}")
    return error
