"""The columns and the index of a log."""

from __future__ import annotations

import numpy as np

ABOUT_LOG = "log.json"
COLUMNS = ("number", "state", "action", "reward", "instruction", "given")
PERCEPT_COLUMN = "percept"
"""Only of environments in which the agent does not perceive the state itself."""
TOLD_COLUMN = "told"
"""Only where a person teaches: who spoke, and what they mark; see ``ibe_rl.instructors.taught``."""
TOLD_SIZE = 3
"""Numbers of a step in that column."""
OPTIONAL = (PERCEPT_COLUMN, TOLD_COLUMN)
DIMENSIONS = {"number": 1, "state": 2, "reward": 1, "instruction": 2, "given": 1, PERCEPT_COLUMN: 2, TOLD_COLUMN: 2}
"""Dimensions of the columns' arrays; actions may have one or two."""
INDEX = np.dtype(
    [
        ("start", "i8"),
        ("number", "i8"),
        ("steps", "i8"),
        ("total_reward", "f8"),
        ("terminated", "?"),
        ("success", "?"),
        ("context", "i8"),
        ("frame", "i8"),
    ]
)
"""One record per episode: its position and a summary; ``frame`` is when it ended."""
