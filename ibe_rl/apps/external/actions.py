"""What an agent or a data set returns as actions, held against the environment's action space."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete, MultiBinary, MultiDiscrete

from ibe_rl.types import Array, ConfigError


def check_action_space(actions: gymnasium.Space[Any]) -> None:
    """Refuse actions that neither a log nor a policy holds.

    Raises:
        ConfigError: naming the space and what is allowed.
    """
    one_row = isinstance(actions, Box | MultiDiscrete | MultiBinary) and len(actions.shape) == 1
    if not isinstance(actions, Discrete) and not one_row:
        raise ConfigError(
            f"env: its actions are {actions}; allowed are Discrete, and MultiDiscrete, MultiBinary or a Box of one "
            "dimension"
        )


def shaped(chosen: Array, actions: gymnasium.Space[Any]) -> Array:
    """Bools and 1.0 as whole numbers, and a column of single numbers in the shape of the space; all else unchanged."""
    if not isinstance(actions, Box) and chosen.dtype.kind in "bf" and np.array_equal(chosen, np.floor(chosen)):
        chosen = chosen.astype(np.int64)
    one = (actions.shape or ()) + (1,)
    if isinstance(actions, Discrete) and chosen.ndim == 2 and chosen.shape[1:] == one:
        return chosen[:, 0]
    if chosen.ndim == 1 and actions.shape == (1,):
        return chosen[:, None]
    return chosen


def fits(chosen: Array, actions: gymnasium.Space[Any], count: int) -> bool:
    """True if ``chosen`` is ``count`` actions of the space; those of a Box may lie outside its bounds."""
    if chosen.shape != (count, *(actions.shape or ())):
        return False
    if isinstance(actions, Box):
        return bool(chosen.dtype.kind in "fiu" and np.isfinite(chosen).all())
    if chosen.dtype.kind not in "iu":
        return False
    low, high = _whole_numbers(actions)
    return bool(np.all((chosen >= low) & (chosen <= high)))


def _whole_numbers(actions: Any) -> tuple[Any, Any]:
    """The lowest and the highest value of each number of an action."""
    if isinstance(actions, Discrete):
        return actions.start, actions.start + actions.n - 1
    if isinstance(actions, MultiDiscrete):
        return actions.start, actions.start + actions.nvec - 1
    return 0, 1


def bounded(chosen: Array, actions: Any) -> Array:
    """Numbers ``(N, A)`` clipped to the bounds of a Box."""
    return np.clip(chosen, actions.low, actions.high)


def check_same_actions(whose: str, declares: Any, actions: gymnasium.Space[Any]) -> None:
    """Compare a declared ``action_space`` with the environment's; without a declaration nothing is checked.

    Raises:
        ConfigError: if they differ, in their bounds too; both are named.
    """
    declared = getattr(declares, "action_space", None)
    if declared is None:
        return
    if type(declared) is not type(actions) or declared.shape != actions.shape:
        raise ConfigError(f"{whose}: its actions are {declared}; allowed are those of the environment, {actions}")
    if _same_values(declared, actions):
        return
    if isinstance(actions, Box):
        raise ConfigError(
            f"{whose}: its actions are {declared} and those of the environment {actions}, so the same number means "
            "something else; allowed are the same bounds, or an agent=MODULE:NAME that rescales them"
        )
    raise ConfigError(f"{whose}: its actions are {declared}; allowed are those of the environment, {actions}")


def _same_values(one: Any, other: Any) -> bool:
    if isinstance(one, Box):
        return np.allclose(one.low, other.low) and np.allclose(one.high, other.high)
    if isinstance(one, Discrete | MultiDiscrete | MultiBinary):
        mine, theirs = _whole_numbers(one), _whole_numbers(other)
        return all(np.array_equal(low, high) for low, high in zip(mine, theirs, strict=True))
    return bool(one == other)
