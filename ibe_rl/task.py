"""What an environment declares of its own, so that nothing else has to know it.

Shapes: ``S`` state dimensions, ``d`` numbers in an instruction, ``O = S + d + 1`` numbers that the policy reads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ibe_rl.types import Array, Episode, Moment


@dataclass(frozen=True)
class Phrases:
    """The words for one number of an expression.

    Attributes:
        zero: said while the magnitude is below the first limit of ``degrees``.
        negative: template with ``{degree}`` for the other expressions below 0.
        positive: the same above 0.
        degrees: pairs (lower limit of the magnitude, word put in for ``{degree}``), rising.
    """

    zero: str
    negative: str
    positive: str
    degrees: Sequence[tuple[float, str]]


@dataclass(frozen=True)
class Task:
    """What an environment declares of its own, so that nothing else has to know it.

    Attributes:
        name: for titles.
        state_names: ``S`` names.
        state_units: ``S`` units.
        rule: the instructor's rule, states ``(..., S)`` to instructions ``(..., d)``.
        instruction_values: the values the rule can give, rising.
        phrases: the words, one entry for each of the ``d`` numbers; said one after the other with "and" between.
        context: initial state ``(S,)`` to the name of what the episode is about.
        contexts: all such names; also the options that ``reset`` takes under ``context_option``.
        context_option: key of the reset option that fixes the context; empty if nothing does.
        success_key: the key in ``info`` that says whether the episode ended well.
        explained: for each number of an instruction the index of the state dimension that it speaks of: with +1 it
            shall rise, with -1 fall. Used for figures and metrics, never by the explainer.
        explained_band: change of each of these, over an explanation's horizon, beyond which it went one way or the
            other.
        max_episode_steps: where the environment cuts an episode off.
        explained_range: how far each of these reaches; errors in it are told in percent of this. Empty: 1 each.
        motion: states ``(..., S)`` to the change ``(..., d)`` of the explained dimensions in one step, if the present
            motion simply goes on. This and the next three, each may be None, only serve to judge explanations.
        goal_offset: states ``(..., S)`` to how far ``(..., d)`` the goal lies above the explained dimensions, signed.
        first_contact: states ``(T + 1, S)`` of an episode to the step at which the eye knows the outcome, or the last.
        hidden_goal: arguments of the environment with which nobody can see where the goal is; or empty.
        scene_path: states ``(..., S)`` to points ``(..., 2)`` in scene units, y up, or None.
        scene_size: width and height of the scene in scene units.
        judges_success: False if nobody says whether an episode ended well.

    Raises:
        ValueError: if there are not as many phrases, explained dimensions, bands and ranges, or a dimension does not
            exist.
    """

    name: str
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    rule: Callable[[Array], Array]
    instruction_values: tuple[float, ...]
    phrases: tuple[Phrases, ...]
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

    def __post_init__(self) -> None:
        if not self.explained_range:
            object.__setattr__(self, "explained_range", (1.0,) * len(self.explained))
        for name in ("explained", "explained_band", "explained_range"):
            if len(getattr(self, name)) != len(self.phrases):
                raise ValueError(
                    f"Task.{name}={getattr(self, name)} has {len(getattr(self, name))} entries but Task.phrases "
                    f"{len(self.phrases)}: allowed is one for each number of an instruction"
                )
        if not all(0 <= dimension < len(self.state_names) for dimension in self.explained):
            raise ValueError(f"Task.explained={self.explained}: allowed are 0 to {len(self.state_names) - 1}")

    @property
    def instruction_size(self) -> int:
        """``d``, the number of numbers in an instruction."""
        return len(self.phrases)

    @property
    def number_names(self) -> tuple[str, ...]:
        """What each number of an instruction is about: ``d`` names of state dimensions."""
        return tuple(self.state_names[dimension] for dimension in self.explained)

    @property
    def observation_size(self) -> int:
        """``O``, what the policy reads: state, instruction, whether it was given."""
        return len(self.state_names) + self.instruction_size + 1


@dataclass(frozen=True)
class Shape:
    """A line or a closed outline to draw: ``points`` ``(P, 2)`` in scene units, y up."""

    points: Array
    colour: tuple[int, int, int]
    closed: bool = False
    radius: float = 0.03


@dataclass(frozen=True)
class RecordedRollout:
    """An episode flown for the viewer, with all that is needed to draw and to explain it.

    Attributes:
        episode: the episode itself.
        moments: ``T`` moments, one before each action.
        background: what stands still.
        figures: ``T + 1`` lists of the outlines that move, the same number with the same points each.
    """

    episode: Episode
    moments: Sequence[Moment]
    background: Sequence[Shape]
    figures: Sequence[Sequence[Shape]]
