"""The settings of two parts of a declared task: its phrases and its mirror image."""

from __future__ import annotations

from dataclasses import dataclass, field

from ibe_rl.config.setting import MISSING


@dataclass
class PhrasesConfig:
    """The words for one number of the instruction; see ``ibe_rl.task.Phrases``."""

    zero: str = MISSING  # said for 0
    negative: str = MISSING  # said for negative numbers; {degree} is replaced by the degree word
    positive: str = MISSING  # the same for positive numbers
    degrees: dict[str, float] = field(default_factory=dict)  # word: its lowest magnitude, rising; empty: task.DEGREES


@dataclass
class MirrorConfig:
    """See ``ibe_rl.task.mirror.Mirror``."""

    flipped: list[str] = MISSING  # names of the state dimensions that change sign
    swapped: list[list[str]] = field(default_factory=list)  # pairs of state dimensions that change places
    instruction: list[float] = field(default_factory=lambda: [-1.0])  # sign of each number of an instruction
    actions: list[int] = field(default_factory=list)  # discrete: for each the one that does the same in the mirror
    action_signs: list[float] = field(default_factory=list)  # continuous: the sign of each number
