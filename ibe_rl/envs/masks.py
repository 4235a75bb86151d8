"""Masks of an environment: which actions are allowed in its present state, as sb3-contrib reads them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiDiscrete

from ibe_rl.types import Array, ConfigError

MASKS = "action_masks"
"""The environment's method, by sb3-contrib's convention."""


def has_masks(env: Any) -> bool:
    """Whether an environment, or a copy of one to predict in, says which actions are allowed."""
    game = getattr(env, "game", env)
    return bool(game.has_wrapper_attr(MASKS)) if isinstance(game, gymnasium.Env) else hasattr(game, MASKS)


def masks_of(env: Any) -> Array:
    """The masks of the present state, ``(n,)`` bool.

    Raises:
        ConfigError: if the environment has none.
    """
    game = getattr(env, "game", env)
    if not has_masks(game):
        raise ConfigError(
            f"agent: it was trained with masks, and {type(getattr(game, 'unwrapped', game)).__name__} has no method "
            f"{MASKS}(); allowed is an environment with one, below all wrappers if it has snapshots of its own"
        )
    masks = game.get_wrapper_attr(MASKS) if isinstance(game, gymnasium.Env) else getattr(game, MASKS)
    return np.asarray(masks(), bool).reshape(-1)


def sampled_action(actions: gymnasium.Space[Any], env: Any) -> Any:
    """A random action, among those that the masks of the environment allow; ``env`` may be None."""
    if env is None or not has_masks(env):
        return actions.sample()
    masks = masks_of(env).astype(np.int8)
    if isinstance(actions, Discrete):
        return actions.sample(mask=masks)
    if isinstance(actions, MultiDiscrete):
        return actions.sample(mask=tuple(np.split(masks, np.cumsum(actions.nvec)[:-1])))
    return actions.sample()
