"""Finds the state dimensions that the instructor's rule depends on, from random episodes before training."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.config.settings import MappingConfig
from ibe_rl.envs.masks import sampled_action
from ibe_rl.ibe.settings import IBEConfig
from ibe_rl.ibe.space import rule_axes
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError

RANDOM_STEPS, STEPS_EACH = 2_000, 200
"""Most states of all episodes together, and steps of each."""
FEW_STATES = 200
"""States that often suffice: a slow environment needs 20 s for all of them."""
FARTHER = (3, 10)
"""Factors by which states are moved from their mean until the rule gives more than one instruction."""
ENOUGH = 0.05
"""Least share of states that get the second most frequent instruction."""
NOTHING = 0.01
"""Share of an axis's largest weight below which a dimension counts as unused."""
WAY_OUT = "allowed is [], or mapping=lasso or mapping.space=all, which compare these dimensions whatever the rule reads"


def check_dimensions(config: MappingConfig, task: Task, env: gymnasium.Env[Any, Any]) -> list[str]:
    """Refuse ``mapping.dimensions`` that the instructor's rule does not depend on, as no vocabulary could be learnt.

    The same few random episodes are rolled out each time. Nothing is refused if the rule is constant in their states
    and in those farther out.

    Args:
        config: of the mapping.
        task: of the environment.
        env: the environment, which is reset.

    Returns:
        Notes for the user on settings that look odd but may work.

    Raises:
        ConfigError: naming the key, the value, what the rule depends on and what is allowed.
    """
    if not _clusters_by_rule(config) or not config.dimensions:
        return []
    kept = np.isin(task.state_names, config.dimensions)
    if _all_read(random_states(env, FEW_STATES), kept, task):
        return []
    states = random_states(env, RANDOM_STEPS)
    for number in range(task.instruction_size):
        asked = _varied_states(states, task, number)
        if asked is None or reads(asked, task, number)[kept].any():
            continue
        if asked is not states or not _correlates(states, kept, task, number):
            read = [task.state_names[row] for row in np.flatnonzero(reads(asked, task, number))]
            of_what = f" of {task.expression_names[number]}" if task.instruction_size > 1 else ""
            raise ConfigError(
                f"mapping.dimensions={list(config.dimensions)}: the instructor's rule{of_what} does not depend on "
                f"them, it reads {', '.join(read)}; {WAY_OUT}"
            )
    still = [task.state_names[row] for row in np.flatnonzero(kept & (np.ptp(states, axis=0) == 0))]
    return [f"mapping.dimensions: {', '.join(still)} did not change in random episodes"] if still else []


def _clusters_by_rule(config: MappingConfig) -> bool:
    return isinstance(config, IBEConfig) and config.space == "rule"


def random_states(env: gymnasium.Env[Any, Any], most: int) -> Array:
    """States ``(most, S)`` of random episodes, the same each time."""
    env.action_space.seed(0)
    states: list[Array] = []
    for seed in range(most):
        state, _ = env.reset(seed=seed)
        states.append(state)
        for _ in range(STEPS_EACH):
            state, _, terminated, truncated, _ = env.step(sampled_action(env.action_space, env))
            states.append(state)
            if terminated or truncated or len(states) >= most:
                break
        if len(states) >= most:
            break
    return np.array(states)


def reads(states: Array, task: Task, number: int) -> Array:
    """Which dimensions ``(S,)`` bool one number of the rule depends on: permuting their values changes it."""
    instructions, random, found = task.rule(states)[:, number], np.random.default_rng(0), []
    for dimension in range(states.shape[1]):
        dealt = states.copy()
        dealt[:, dimension] = random.permutation(states[:, dimension])
        found.append(bool(np.any(task.rule(dealt)[:, number] != instructions)))
    return np.array(found)


def _all_read(states: Array, kept: Array, task: Task) -> bool:
    """Whether all ``kept`` dimensions move in these states, and each number of the rule varies with one of them."""
    moved = bool((np.ptp(states, axis=0)[kept] > 0).all())
    numbers = range(task.instruction_size)
    return moved and all(_varies(states, task, one) and reads(states, task, one)[kept].any() for one in numbers)


def _varied_states(states: Array, task: Task, number: int) -> Array | None:
    """States in which the rule varies: the given ones or ones farther out; None if it is constant."""
    if _varies(states, task, number):
        return states
    for factor in FARTHER:
        asked = (states.mean(axis=0) + factor * (states - states.mean(axis=0))).astype(states.dtype)
        if _varies(asked, task, number):
            return asked
    return None


def _varies(states: Array, task: Task, number: int) -> bool:
    """Whether at least two instructions are frequent in these states."""
    counts = np.sort(np.unique(task.rule(states)[:, number], return_counts=True)[1])
    return len(counts) > 1 and bool(counts[-2] >= ENOUGH * len(states))


def _correlates(states: Array, kept: Array, task: Task, number: int) -> bool:
    """Whether the rule correlates with any of the ``kept`` dimensions without depending on them."""
    instructions = task.rule(states)[:, number]
    weights = np.abs(rule_axes(states, instructions[:, None], seed=0)[:, 0]) * states.std(axis=0)
    return bool(weights[kept].max() > NOTHING * weights.max())


def lead_on(config: MappingConfig, skipped: int) -> str:
    """Advice if refreshes keep being skipped before the first vocabulary; empty at the first one."""
    if skipped < 2:
        return ""
    ways: Sequence[str] = [
        *(["leave mapping.dimensions empty"] if config.dimensions else []),
        *(["use mapping=lasso, which uses the movements and not the rule"] if _clusters_by_rule(config) else []),
        "let the rule say -1 and 1 in states that good episodes reach",
    ]
    return f"; {skipped} refreshes were skipped so far and there are no words yet: train longer, {', or '.join(ways)}"
