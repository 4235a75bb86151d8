"""How a setting is declared: a field of a dataclass with its limits, which ``limits`` checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

MISSING: Any = "???"
"""Hydra's marker for a setting that must be given."""
TINY = 1e-9
"""Lower limit of settings that must be above 0."""
KEPT = {"kept": True}
"""Metadata of a field without limits that a resumed run keeps; see ``setting``."""


def setting(
    default: Any,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
    kept: bool = False,
    learnt: bool = True,
) -> Any:
    """A field with limits.

    Args:
        default: default value.
        low: lowest allowed value.
        high: highest allowed value.
        choices: the only allowed values.
        kept: a resumed run keeps it; for a group, everything in it.
        learnt: False if what a predictor learns does not depend on it.
    """
    metadata = {"low": low, "high": high, "choices": tuple(choices), "kept": kept, "learnt": learnt}
    return field(default=default, metadata=metadata)
