"""ibe_rl: agents that explain themselves while they learn, in their instructor's words.

Importing it registers the environments with gymnasium. IBE itself works on plain arrays. It is imported at first
use, and so is what needs torch. docs/API.md lists the public API.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ibe_rl.envs import Instructed
from ibe_rl.task import Phrases, Task
from ibe_rl.types import ConfigError, Episode

if TYPE_CHECKING:
    from ibe_rl.ibe import (
        ClusterMapping,
        Evidence,
        IBEMapping,
        Interpretation,
        Meaning,
        Reactions,
        cut_windows,
        delta_states,
        interpret,
        phrase,
        top_episodes,
    )

__version__ = "0.1.0"

IMPORTED_LATER = {
    **dict.fromkeys(("Study", "open_study", "study"), "ibe_rl.apps.external.study"),
    **dict.fromkeys(("export_log", "import_log"), "ibe_rl.apps.minari"),
}

__all__ = [
    "ClusterMapping",
    "ConfigError",
    "Episode",
    "Evidence",
    "IBEMapping",
    "Instructed",
    "Interpretation",
    "Meaning",
    "Phrases",
    "Reactions",
    "Study",
    "Task",
    "cut_windows",
    "delta_states",
    "export_log",
    "import_log",
    "interpret",
    "open_study",
    "phrase",
    "study",
    "top_episodes",
]


def __getattr__(name: str) -> Any:
    """Import a part at first use."""
    if name in __all__:
        return getattr(import_module(IMPORTED_LATER.get(name, "ibe_rl.ibe")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
