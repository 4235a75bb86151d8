"""ibe_rl: agents that explain themselves while they learn, in their instructor's words.

Importing it registers the environments with gymnasium. IBE itself works on plain arrays; what needs torch is imported
at first use. docs/API.md lists the public API.
"""

import sys
from importlib import import_module
from typing import Any

if sys.platform == "win32":
    sys.exit("error: ibe_rl runs on Linux and macOS; on Windows run it in WSL, which is Linux: wsl --install")

from ibe_rl.envs import Instructed
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
from ibe_rl.task import Phrases, Task
from ibe_rl.types import ConfigError, Episode

WITH_TORCH = {
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
    """Import what needs torch at first use."""
    if name in WITH_TORCH:
        return getattr(import_module(WITH_TORCH[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
