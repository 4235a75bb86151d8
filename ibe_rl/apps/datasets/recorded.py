"""An episode as somebody recorded it, checked and converted to ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from ibe_rl.apps.datasets.instruction_source import InstructionSource, instructed_size
from ibe_rl.apps.external.actions import bounded, fits, shaped
from ibe_rl.runtime.printed import raised
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode

DATASET_SUCCESS, DATASET_PERCEPT = "success", "percept"
ROUNDING = 1e-4
"""How far a recorded action may lie outside its bounds."""


@dataclass(frozen=True)
class RawEpisode:
    """An episode of ``T`` steps as it was recorded.

    Attributes:
        where: the data set and the number of the episode, for messages.
        observations: ``T + 1``, an array or a dict or tuple of arrays.
        actions: ``T``.
        rewards: ``T``.
        terminations: ``T`` bools.
        truncations: ``T`` bools.
        infos: arrays of ``T`` or ``T + 1`` rows by name.
        seed: that the environment was reset with; None: unknown.
    """

    where: str
    observations: Any
    actions: Any
    rewards: Any
    terminations: Any
    truncations: Any
    infos: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None

    def refuse(self, what: str, allowed: str) -> ConfigError:
        """The error for this episode."""
        return ConfigError(f"{self.where}: {what}; allowed {allowed}")


@dataclass
class Conversion:
    """From recorded episodes to those of a task; the same for all episodes of a data set.

    Args:
        task: of the environment.
        actions: its action space.
        instruction_source: where the instruction is from.
        state: one observation to its state ``(S,)``; None: the observation is the state, perhaps with the instruction.
        succeeded: (last state, terminated, truncated) to success, where no info says it; None: then it is no success.

    Attributes:
        seeds: of the episodes so far.
        without_success: episodes without a word about success.
        without_end: episodes whose recording stopped before their end.
    """

    task: Task
    actions: gymnasium.Space[Any]
    instruction_source: InstructionSource
    state: Callable[[Any], Any] | None = None
    succeeded: Callable[[Array, bool, bool], bool] | None = None
    seeds: list[int | None] = field(default_factory=list)
    without_success: int = 0
    without_end: int = 0

    def __call__(self, recorded: RawEpisode) -> Episode:
        """Convert one episode.

        Raises:
            ConfigError: naming the data set, the episode, what is wrong with it and what is allowed.
        """
        rewards = _rewards(recorded)
        rows = self._rows(recorded, len(rewards))
        states = rows[:, : len(self.task.state_names)]
        terminated, truncated = _end(recorded, len(rewards))
        self.without_end += not (terminated or truncated)
        instructions, given = self.instruction_source.of(recorded, rows, len(rewards))
        episode = Episode(
            states=states,
            actions=self._actions(recorded, len(rewards)),
            rewards=rewards,
            instructions=instructions,
            given=given,
            terminated=terminated,
            success=self._success(recorded, states[-1], terminated, truncated),
            context=self._context(recorded, states[0]),
            percepts=self._percepts(recorded, len(states)),
        )
        self.seeds.append(recorded.seed)
        return episode

    def _rows(self, recorded: RawEpisode, steps: int) -> Array:
        """States ``(T + 1, S)``, or whole observations ``(T + 1, O)``, float32."""
        found = recorded.observations if self.state is None else self._states(recorded, self.state, steps)
        rows = _numbers(recorded, "observations", found)
        if len(rows) == steps:
            raise recorded.refuse(
                f"it has {steps} observations for {steps} actions",
                f"are {steps + 1}: the state after the last action belongs to it",
            )
        size = len(self.task.state_names)
        sizes = (size,) if self.state else (size, instructed_size(self.task))
        if rows.shape not in [(steps + 1, size) for size in sizes]:
            whole = "" if self.state else f", or {(steps + 1, sizes[-1])} with the instruction and whether it was given"
            raise recorded.refuse(
                f"its observations have the shape {rows.shape}", f"is {(steps + 1, sizes[0])}, the state{whole}"
            )
        if steps > self.task.max_episode_steps:
            raise recorded.refuse(
                f"it has {steps} steps", f"are at most {self.task.max_episode_steps} (the environment's)"
            )
        return rows.astype(np.float32)

    def _states(self, recorded: RawEpisode, state: Callable[[Any], Any], steps: int) -> list[Any]:
        try:
            return [state(_at(recorded.observations, step)) for step in range(steps + 1)]
        except ConfigError as error:
            raise ConfigError(f"{recorded.where}: {error}") from None
        except Exception as error:  # code of the user may raise anything
            raise recorded.refuse(
                f"the function of --state raised {raised(error)}", "is one observation to the state"
            ) from None

    def _actions(self, recorded: RawEpisode, steps: int) -> Array:
        actions = shaped(np.asarray(recorded.actions), self.actions)
        if not fits(actions, self.actions, len(actions)) or len(actions) != steps:
            row = next((row for row in range(len(actions)) if not fits(actions[row : row + 1], self.actions, 1)), None)
            which = f"its actions have the shape {actions.shape}" if row is None else f"step {row} has {actions[row]}"
            raise recorded.refuse(which, f"are {steps} actions of {self.actions}")
        if isinstance(self.actions, Box):
            outside = np.abs(actions - bounded(actions, self.actions)) > ROUNDING
            if outside.any():
                row = int(np.flatnonzero(outside.any(axis=1))[0])
                raise recorded.refuse(f"step {row} has the action {actions[row].tolist()}", f"is {self.actions}")
        return actions

    def _success(self, recorded: RawEpisode, state: Array, terminated: bool, truncated: bool) -> bool:
        """Success as of the last infos, else by the task's function; False without either."""
        key = next((name for name in (DATASET_SUCCESS, self.task.success_key) if name in recorded.infos), None)
        if key is None and self.succeeded is not None:
            return bool(self.succeeded(state.copy(), terminated, truncated))
        if key is None:
            self.without_success += 1
            return False
        last = np.asarray(recorded.infos[key]).reshape(-1)[-1:]
        if last.dtype.kind not in "biuf" or last.tolist() not in ([0], [1]):
            raise recorded.refuse(f"infos[{key!r}] ends with {last.tolist()!s:.40}", "is a bool")
        return bool(last[0])

    def _percepts(self, recorded: RawEpisode, count: int) -> Array | None:
        """What the agent perceived, as exported; None where that is the state, or was not kept."""
        if not self.task.parts or DATASET_PERCEPT not in recorded.infos:
            return None
        kept, shape = np.asarray(recorded.infos[DATASET_PERCEPT]), (count, self.task.percept_size)
        if kept.shape != shape:
            raise recorded.refuse(f"infos[{DATASET_PERCEPT!r}] has the shape {kept.shape}", f"is {shape}")
        return kept.astype(self.task.percept_type)

    def _context(self, recorded: RawEpisode, state: Array) -> str:
        found = self.task.context(state.copy())
        if found not in self.task.contexts:
            raise recorded.refuse(f"its context is {found!r}", f"is one of {', '.join(self.task.contexts)}")
        return found


def _at(observations: Any, step: int) -> Any:
    """One observation of a whole episode."""
    if isinstance(observations, Mapping):
        return {name: _at(part, step) for name, part in observations.items()}
    if isinstance(observations, tuple):
        return tuple(_at(part, step) for part in observations)
    return observations[step]


def _numbers(recorded: RawEpisode, name: str, found: Any) -> Array:
    """Finite numbers, in rows."""
    try:
        numbers = np.asarray(found)
    except ValueError:
        numbers = np.empty(0, object)
    if isinstance(found, Mapping | tuple):
        kind = f"the keys {', '.join(found)}" if isinstance(found, Mapping) else f"{len(found)} parts"
        raise recorded.refuse(
            f"its observations have {kind}", "is a row of numbers, or --state=MODULE:NAME, one observation to the state"
        )
    if numbers.dtype.kind not in "biuf" or not numbers.ndim:
        raise recorded.refuse(f"its {name} are of type {numbers.dtype}", "are numbers of the same count in each step")
    wrong = ~np.isfinite(numbers).all(axis=tuple(range(1, numbers.ndim)))
    if wrong.any():
        step = int(np.flatnonzero(wrong)[0])
        raise recorded.refuse(f"{name} of step {step} are {numbers[step].tolist()!s:.80}", "are finite numbers")
    return numbers


def _rewards(recorded: RawEpisode) -> Array:
    rewards = _numbers(recorded, "rewards", recorded.rewards)
    if rewards.ndim == 2 and rewards.shape[1] == 1:
        rewards = rewards[:, 0]
    if rewards.ndim != 1 or not len(rewards):
        raise recorded.refuse(
            f"its rewards have the shape {rewards.shape}", "is one number a step, and at least one step"
        )
    return rewards.astype(np.float32)


def _end(recorded: RawEpisode, steps: int) -> tuple[bool, bool]:
    """Whether the last step terminated and whether it truncated it."""
    ends = []
    for name in ("terminations", "truncations"):
        flags = np.asarray(getattr(recorded, name)).reshape(-1)
        if len(flags) != steps or flags.dtype.kind not in "biuf":
            raise recorded.refuse(f"its {name} are {len(flags)} of type {flags.dtype}", f"are {steps} bools")
        if flags[:-1].any():
            raise recorded.refuse(
                f"it goes on after its end at step {int(np.argmax(flags))}", "is one end, the last step"
            )
        ends.append(bool(flags[-1]))
    return ends[0], ends[1]
