"""What the instructor's rule reads: it is asked in states of a few random episodes, before anything is trained."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.space import rule_axes
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError

RANDOM_STEPS, STEPS_EACH = 2_000, 200
"""Of all episodes together, and of one of them."""
FARTHER = (3, 10)
"""Times as far from their mean the states are taken, until the rule says more than one thing."""
ENOUGH = 0.05
"""Share of the states in which something has to be said, to see what it depends on."""
NOTHING = 0.01
"""Share of the largest weight on an axis under which a dimension has none."""
WAY_OUT = "allowed is [], or mapping=lasso or mapping.space=all, which compare these dimensions whatever the rule reads"


def check_dimensions(config: MappingConfig, task: Task, env: gymnasium.Env[Any, Any]) -> list[str]:
    """Refuse ``mapping.dimensions`` on which no word of the instructor turns, since no vocabulary could be learnt.

    A few random episodes are played, always the same. Nothing is refused where the rule says one thing only in
    them, and farther out too.

    Args:
        config: of the mapping.
        task: of the environment.
        env: the environment, which is reset.

    Returns:
        Notes for the person, on what looks odd and may still work.

    Raises:
        ConfigError: naming the key, the value, what the rule does read and what is allowed.
    """
    if config.space != "rule" or not config.dimensions:
        return []
    states = random_states(env)
    kept = np.isin(task.state_names, config.dimensions)
    for number in range(task.instruction_size):
        asked = _telling(states, task, number)
        if asked is None or reads(asked, task, number)[kept].any():
            continue
        if asked is not states or not _goes_with(states, kept, task, number):
            read = [task.state_names[row] for row in np.flatnonzero(reads(asked, task, number))]
            of_what = f" of {task.number_names[number]}" if task.instruction_size > 1 else ""
            raise ConfigError(
                f"mapping.dimensions={list(config.dimensions)}: the instructor's rule{of_what} does not depend on "
                f"them, it reads {', '.join(read)}; {WAY_OUT}"
            )
    still = [task.state_names[row] for row in np.flatnonzero(kept & (np.ptp(states, axis=0) == 0))]
    return [f"note: mapping.dimensions: {', '.join(still)} did not change in random episodes"] if still else []


def random_states(env: gymnasium.Env[Any, Any]) -> Array:
    """States ``(N, S)`` of random episodes, the same each time."""
    env.action_space.seed(0)
    states: list[Array] = []
    for seed in range(RANDOM_STEPS):
        state, _ = env.reset(seed=seed)
        states.append(state)
        for _ in range(STEPS_EACH):
            state, _, terminated, truncated, _ = env.step(env.action_space.sample())
            states.append(state)
            if terminated or truncated or len(states) >= RANDOM_STEPS:
                break
        if len(states) >= RANDOM_STEPS:
            break
    return np.array(states)


def reads(states: Array, task: Task, number: int) -> Array:
    """Which dimensions ``(S,)`` bool one number of the rule reads: it says something else with other values of them."""
    told, random, found = task.rule(states)[:, number], np.random.default_rng(0), []
    for dimension in range(states.shape[1]):
        dealt = states.copy()
        dealt[:, dimension] = random.permutation(states[:, dimension])
        found.append(bool(np.any(task.rule(dealt)[:, number] != told)))
    return np.array(found)


def _telling(states: Array, task: Task, number: int) -> Array | None:
    """States in which the rule says more than one thing: those, or farther out, where random play never gets."""
    if _tells(states, task, number):
        return states
    for factor in FARTHER:
        asked = (states.mean(axis=0) + factor * (states - states.mean(axis=0))).astype(states.dtype)
        if _tells(asked, task, number):
            return asked
    return None


def _tells(states: Array, task: Task, number: int) -> bool:
    """Whether at least two things are said in them, and neither hardly ever."""
    counts = np.sort(np.unique(task.rule(states)[:, number], return_counts=True)[1])
    return len(counts) > 1 and bool(counts[-2] >= ENOUGH * len(states))


def _goes_with(states: Array, kept: Array, task: Task, number: int) -> bool:
    """Whether what the rule says goes with any of the ``kept`` dimensions, though it does not read them."""
    told = task.rule(states)[:, number]
    weights = np.abs(rule_axes(states, told[:, None], seed=0)[:, 0]) * states.std(axis=0)
    return bool(weights[kept].max() > NOTHING * weights.max())


def lead_on(config: MappingConfig, skipped: int) -> str:
    """What a person can do if refresh after refresh is skipped and there is no vocabulary yet; empty at the first."""
    if skipped < 2:
        return ""
    ways: Sequence[str] = [
        *(["leave mapping.dimensions empty"] if config.dimensions else []),
        *(["take mapping=lasso, which goes by what moved and not by the rule"] if config.space == "rule" else []),
        "let the rule say -1 and 1 in states that good episodes reach",
    ]
    return f"; {skipped} refreshes were skipped so far and there are no words yet: train longer, {', or '.join(ways)}"
