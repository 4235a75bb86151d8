"""ibe_rl: agents that explain themselves while they learn, in their instructor's words.

Importing it registers the environments with gymnasium. IBE itself works on plain arrays. It is imported at first
use, and so is what needs torch. docs/API.md lists the public API.
"""

import sys
from importlib import import_module
from typing import Any
from warnings import warn

if sys.platform == "win32":
    sys.exit("error: ibe_rl runs on Linux and macOS; on Windows run it in WSL, which is Linux: wsl --install")

from ibe_rl.envs import Instructed
from ibe_rl.task import Mirror, Phrases, Task
from ibe_rl.types import ConfigError, Episode

__version__ = "0.1.0"

IMPORTED_LATER = {
    **dict.fromkeys(("ExplainedAgent", "Narration", "explain_agent", "open_run"), "ibe_rl.api.explained"),
    **dict.fromkeys(("resume", "train"), "ibe_rl.api.loop"),
    "Listener": "ibe_rl.vocabulary.listener",
    "Run": "ibe_rl.training.run",
    "build": "ibe_rl.training.build",
    "settings": "ibe_rl.api.settings",
    **dict.fromkeys(("export_log", "import_log"), "ibe_rl.apps.minari"),
}

RENAMED = {"Study": "ExplainedAgent", "open_study": "open_run", "study": "explain_agent"}
"""Names of version 0.1, which still work in this one, to those that took their place."""

__all__ = [
    "ClusterMapping",
    "ConfigError",
    "Episode",
    "Evidence",
    "ExplainedAgent",
    "IBEMapping",
    "Instructed",
    "Interpretation",
    "Listener",
    "Meaning",
    "Mirror",
    "Narration",
    "Phrases",
    "Reactions",
    "Run",
    "Task",
    "build",
    "cut_windows",
    "delta_states",
    "explain_agent",
    "export_log",
    "import_log",
    "interpret",
    "open_run",
    "phrase",
    "resume",
    "settings",
    "top_episodes",
    "train",
]


def __getattr__(name: str) -> Any:
    """Import a part at first use."""
    if name in RENAMED:
        warn(f"ibe_rl.{name} is called ibe_rl.{RENAMED[name]} now", DeprecationWarning, stacklevel=2)
        name = RENAMED[name]
    if name in __all__:
        return getattr(import_module(IMPORTED_LATER.get(name, "ibe_rl.ibe")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
