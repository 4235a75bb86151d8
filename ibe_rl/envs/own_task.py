"""Environments that declare their task themselves."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium.wrappers import TimeLimit

from ibe_rl.envs.functions import with_checks
from ibe_rl.envs.gate import Gate
from ibe_rl.envs.sensing import Sense
from ibe_rl.envs.wrappers import Declared
from ibe_rl.task import Task
from ibe_rl.types import ConfigError


def with_own_task(env: gymnasium.Env[Any, Any], label: str) -> gymnasium.Env[Any, Any]:
    """The environment behind its gate, with its own task.

    Args:
        env: with its time limit.
        label: what the user calls it.

    Raises:
        ConfigError: if it has no task or no time limit.
    """
    task = env.get_wrapper_attr("task") if env.has_wrapper_attr("task") else None
    if not isinstance(task, Task):
        raise ConfigError(
            f"{label}: it declares no task; allowed is an environment with an attribute task of type "
            "ibe_rl.task.Task, or to declare it in env.task (docs/OWN_ENVIRONMENT.md)"
        )
    limit = None if env.spec is None else env.spec.max_episode_steps
    if limit is None:
        raise ConfigError(
            f"{label}: it is registered without a time limit; allowed is max_episode_steps={task.max_episode_steps}, "
            "as its task says, so that every episode ends"
        )
    if limit > task.max_episode_steps:
        env = TimeLimit(env, task.max_episode_steps)
    checked = with_checks(task, {}, "task")
    names = () if task.state else task.state_names
    plain = Sense(env, task.state, task.observes).as_it_is
    gate = Gate(env, label, task.success_key, names, checked if plain else None)
    return gate if plain else Declared(gate, checked)
