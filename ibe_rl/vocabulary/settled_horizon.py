"""The horizon of a mapping once it is known."""

from __future__ import annotations

from ibe_rl.config.settings import MappingConfig


def horizon_of(config: MappingConfig) -> int:
    """The n of a mapping, set or found.

    Raises:
        ValueError: if it has still to be found (``find_steps``).
    """
    if config.horizon_steps is None:
        raise ValueError("mapping.horizon_steps=null: it has not been found yet")
    return config.horizon_steps
