"""ibe_rl: agents that explain themselves while they learn, in the words they were taught with.

Importing it registers the environments with gymnasium; IBE itself works on plain arrays, without torch. Agents that
were trained elsewhere are explained by ``study`` and ``open_study``, which bring torch in when they are asked for.
"""

from importlib import import_module
from typing import Any

import ibe_rl.env  # noqa: F401 - registers the environments
from ibe_rl.ibe import ClusterMapping, IBEMapping, cut_windows, delta_states, phrase, top_episodes

WITH_TORCH = {"study": "ibe_rl.own_agent", "open_study": "ibe_rl.own_agent", "Study": "ibe_rl.own_agent"}

__all__ = ["ClusterMapping", "IBEMapping", "cut_windows", "delta_states", "phrase", "top_episodes"]


def __getattr__(name: str) -> Any:
    """What needs torch, imported when it is first asked for."""
    if name in WITH_TORCH:
        return getattr(import_module(WITH_TORCH[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
