"""Learn the vocabulary from the log as it stands, and say what it stands on."""

from __future__ import annotations

import json
from collections.abc import Mapping as Dict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.data import Array, Episode
from ibe_rl.ibe import ClusterMapping, PaperMapping, TooLittleDataError, Windows, cut_windows, top_episodes
from ibe_rl.log import TrajectoryLog


@dataclass(frozen=True)
class Refresh:
    """A vocabulary and what it was learnt from.

    Attributes:
        frame: training frames when it was learnt.
        mapping: the vocabulary.
        top: the windows of the best episodes that it was learnt from.
        others: windows of other episodes, a sample, for comparison only.
        episodes_logged: whole episodes in the log.
        episodes_used: the best ones among them.
        episodes_by_context: of the best ones, for the lander by pad.
        windows_by_context: windows used, likewise.
        windows_by_instruction: windows used, by the instruction they began with.
    """

    frame: int
    mapping: ClusterMapping
    top: Windows
    others: Windows
    episodes_logged: int
    episodes_used: int
    episodes_by_context: Dict[str, int]
    windows_by_context: Dict[str, int]
    windows_by_instruction: Dict[str, int]
