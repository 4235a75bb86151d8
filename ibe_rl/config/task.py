"""What can be declared of an environment in its file in ``configs/env``, where it does not declare it itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from ibe_rl.config.limits import setting

DEGREES = {"slightly": 0.15, "moderately": 0.4, "": 0.75}


@dataclass
class PhrasesConfig:
    """The words for one number of the instruction; see ``ibe_rl.task.Phrases``."""

    zero: str = MISSING
    negative: str = MISSING  # with {degree} where the word for it goes
    positive: str = MISSING
    degrees: dict[str, float] = field(default_factory=lambda: dict(DEGREES))  # word: from which magnitude on, rising


@dataclass
class TaskConfig:
    """See ``ibe_rl.task.Task``. What is ``module:name`` is a function, or a class that is made without arguments.

    Modules are looked for where Python does and in the folder that the program was started in.
    """

    name: str = MISSING
    rule: str = MISSING  # module:name; states (..., S) to instructions (..., d)
    phrases: list[PhrasesConfig] = MISSING  # one for each number of the instruction
    explained: list[str] = MISSING  # the state dimensions that its numbers speak of: each rises where the rule says +1
    explained_band: list[float] = MISSING  # change of each beyond which it went one way or the other
    explained_range: list[float] = field(default_factory=list)  # how far each reaches; empty: 1 each
    instruction_values: list[float] = field(default_factory=lambda: [-1.0, 0.0, 1.0])  # that each number can have
    state_names: list[str] = field(default_factory=list)  # empty: state_0, state_1, ...
    state_units: list[str] = field(default_factory=list)  # empty: none
    max_episode_steps: int | None = setting(None, low=1)  # None: as it is registered
    success: str | None = None  # module:name; last state (S,), terminated, truncated to bool
    success_key: str | None = None  # or the key of its info that says so; with neither nothing counts as success
    context: str | None = None  # module:name; first state (S,) to the name of what the episode is about
    contexts: list[str] = field(default_factory=list)  # all such names
    context_option: str | None = None  # the key of the reset option that fixes it
    motion: str | None = None  # module:name; states (..., S) to the change (..., d) in one step as it moves now
    goal_offset: str | None = None  # module:name; states (..., S) to how far (..., d) the goal lies above
    first_contact: str | None = None  # module:name; states (T + 1, S) to the step at which the outcome is seen
    hidden_goal: dict[str, Any] = field(default_factory=dict)  # arguments with which nobody can see the goal
    scene_path: str | None = None  # module:name; states (..., S) to points (..., 2) of a drawing, y up
    scene_size: list[float] = field(default_factory=lambda: [1.0, 1.0])  # width and height of the drawing
    background: str | None = None  # module:name; the environment to the list of ibe_rl.task.Shape that stand still
    figure: str | None = None  # module:name; the environment to those that move


FUNCTIONS = (
    *("rule", "success", "context", "motion", "goal_offset", "first_contact"),
    *("scene_path", "background", "figure"),
)
"""The settings that name code."""


def code_of(env_id: str, declared: TaskConfig | None) -> set[str]:
    """All code outside this package that making an environment and calling what is declared of it would run."""
    named = {getattr(declared, name) for name in FUNCTIONS} - {None} if declared else set()
    named |= {env_id} if ":" in env_id else set()
    return {one for one in named if not one.startswith("ibe_rl.envs.")}
