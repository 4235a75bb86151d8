"""What an environment declares about itself; the rest of the package is environment-independent.

Shapes: ``S`` state dimensions, ``d`` numbers in an instruction (of words: slots), ``P`` numbers of a percept,
``O = P + d + 1`` in an observation.

``words`` has what is said: an environment's phrases for numbers, or the words of whoever teaches.

In: what an environment declares.
Out: the same, checked.
Imports: types.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from ibe_rl.task.mirror import Mirror as Mirror
from ibe_rl.task.words import DEGREES as DEGREES
from ibe_rl.task.words import Phrases as Phrases
from ibe_rl.task.words import Words
from ibe_rl.types import Array, Episode, Moment

PERCEPT = "ibe_rl/percept"
"""Key in ``info`` of what the agent perceives ``(P,)``, where that is not the state."""
NUMBERS, FLAGS, IMAGE = "numbers", "flags", "image"


@dataclass(frozen=True)
class Part:
    """Consecutive numbers of a percept.

    Attributes:
        name: where they are in the environment's observation, as ``goal/position``; empty for all of it.
        kind: ``NUMBERS``; ``FLAGS``, 0 or 1, of a category; ``IMAGE``, bytes.
        shape: in the observation, ``(height, width, channels)`` of an image.
        channels_first: of an image, ``(channels, height, width)`` in the row.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    channels_first: bool = False

    @property
    def size(self) -> int:
        """How many numbers it has."""
        return prod(self.shape)


@dataclass(frozen=True)
class Task:
    """What an environment declares about itself.

    Attributes:
        name: for titles.
        state_names: ``S`` names.
        state_units: ``S`` units.
        rule: the instructor's rule, states ``(..., S)`` to instructions ``(..., d)``.
        instruction_values: the values the rule can give, rising.
        phrases: one entry for each of the ``d`` numbers; joined with "and". Or the words of whoever teaches.
        context: initial state ``(S,)`` to the name of the context.
        contexts: all such names; also the values of the reset option ``context_option``.
        context_option: key of the reset option that fixes the context; empty if nothing does.
        success_key: the key in ``info`` that holds whether the episode succeeded.
        explained: for each number of an instruction, the index of its state dimension: +1 asks for a rise, -1 for a
            fall. Used for figures and metrics, never by the explainer.
        explained_band: change of each of these, over an explanation's horizon, beyond which it counts as a rise or
            fall.
        max_episode_steps: where the environment truncates an episode.
        explained_range: the range of each of these; errors are reported in percent of it. Empty: 1 each.
        motion: states ``(..., S)`` to the change ``(..., d)`` of the explained dimensions in one step at constant
            motion. This and the next three are optional and only used to judge explanations.
        goal_offset: states ``(..., S)`` to the signed offset ``(..., d)`` of the goal from the explained dimensions.
        first_contact: states ``(T + 1, S)`` of an episode to the step at which the outcome is visible, or the last.
        hidden_goal: arguments of the environment that hide the goal; or empty.
        scene_path: states ``(..., S)`` to points ``(..., 2)`` in scene units, y up, or None.
        scene_size: width and height of the scene in scene units.
        judges_success: False if the environment does not report success.
        state: (environment without wrappers, its observation) to the state ``(S,)``, for environments whose observation
            is no row of numbers, or not what shall be explained. None: the observation is the state.
        observes: keys of a Dict observation that the agent perceives; empty: all.
        mirror: its mirror image, where that is the same environment; None: it is not.
        parts: of a percept, set when the environment is made; empty: the agent perceives the state itself.

    Raises:
        ValueError: if phrases, explained dimensions, bands and ranges differ in number, or a dimension does not exist.
    """

    name: str
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    rule: Callable[[Array], Array]
    instruction_values: tuple[float, ...]
    phrases: tuple[Phrases, ...] | Words
    context: Callable[[Array], str]
    contexts: tuple[str, ...]
    context_option: str
    success_key: str
    explained: tuple[int, ...]
    explained_band: tuple[float, ...]
    max_episode_steps: int
    explained_range: tuple[float, ...] = ()
    motion: Callable[[Array], Array] | None = None
    goal_offset: Callable[[Array], Array] | None = None
    first_contact: Callable[[Array], int] | None = None
    hidden_goal: Mapping[str, Any] = field(default_factory=dict)
    scene_path: Callable[[Array], Array] | None = None
    scene_size: tuple[float, float] = (1.0, 1.0)
    judges_success: bool = True
    state: Callable[[Any, Any], Array] | None = None
    observes: tuple[str, ...] = ()
    mirror: Mirror | None = None
    parts: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        if not self.explained_range:
            object.__setattr__(self, "explained_range", (1.0,) * len(self.explained))
        for name in ("explained", "explained_band", "explained_range"):
            if self.words is None and len(getattr(self, name)) != len(self.phrases):
                raise ValueError(
                    f"Task.{name}={getattr(self, name)} has {len(getattr(self, name))} entries but Task.phrases "
                    f"{len(self.phrases)}: allowed is one for each number of an instruction"
                )
        if not all(0 <= dimension < len(self.state_names) for dimension in self.explained):
            raise ValueError(f"Task.explained={self.explained}: allowed are 0 to {len(self.state_names) - 1}")
        if self.mirror and self.words is None:
            self.mirror.check(self.state_names, len(self.phrases))

    @property
    def words(self) -> Words | None:
        """The words of whoever teaches; None where instructions are numbers."""
        return self.phrases if isinstance(self.phrases, Words) else None

    @property
    def instruction_size(self) -> int:
        """``d``, numbers in an instruction; of words: slots."""
        return len(self.phrases)

    @property
    def expression_names(self) -> tuple[str, ...]:
        """What each number of an expression is called, ``d`` names: of its state dimension, or the word."""
        return self.number_names if self.words is None else tuple(map(self.words.name_at, range(len(self.words))))

    @property
    def number_names(self) -> tuple[str, ...]:
        """The explained state dimensions, one for each number of an instruction; of words, those to judge them by."""
        return tuple(self.state_names[dimension] for dimension in self.explained)

    @property
    def directions(self) -> tuple[float, ...]:
        """The values that a direction is judged by: those of an instruction, or -1, 0 and 1 where it is a word."""
        return self.instruction_values if self.words is None else (-1.0, 0.0, 1.0)

    @property
    def percept_size(self) -> int:
        """``P``, the size of what the agent perceives of the environment, mostly its state."""
        return sum(part.size for part in self.parts) or len(self.state_names)

    @property
    def percept_type(self) -> type[np.generic]:
        """Of its numbers: bytes where it consists of images and flags."""
        return np.float32 if any(part.kind == NUMBERS for part in self.parts) or not self.parts else np.uint8

    @property
    def observation_size(self) -> int:
        """``O``, the size of percept, instruction and whether it was given."""
        return self.percept_size + self.instruction_size + 1


@dataclass(frozen=True)
class Shape:
    """A line or closed outline to draw: ``points`` ``(P, 2)`` in scene units, y up."""

    points: Array
    colour: tuple[int, int, int]
    closed: bool = False
    radius: float = 0.03


@dataclass(frozen=True)
class RecordedRollout:
    """An episode rolled out for the viewer, with all that is needed to draw and explain it.

    Attributes:
        episode: the episode itself.
        moments: ``T`` moments, one before each action.
        background: static shapes.
        figures: ``T + 1`` lists of moving shapes, with the same number of shapes and points each.
    """

    episode: Episode
    moments: Sequence[Moment]
    background: Sequence[Shape]
    figures: Sequence[Sequence[Shape]]


def choices_of(space: Any) -> list[tuple[int, int]]:
    """The sizes and first values of a row of choices (MultiDiscrete, MultiBinary); empty for other action spaces."""
    if len(space.shape or ()) != 1:
        return []
    if hasattr(space, "nvec"):
        return list(zip(space.nvec.tolist(), space.start.tolist(), strict=True))
    return [(2, 0)] * space.shape[0] if hasattr(space, "n") else []
