"""Environments that a Python program gives: a function that makes one, an object, or an id with a ``Task``."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
from gymnasium.wrappers import TimeLimit

from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs.sensing import Sense
from ibe_rl.envs.wrappers import Declared
from ibe_rl.runtime.import_string import raised
from ibe_rl.task import Task
from ibe_rl.types import ConfigError

MakeGym = Callable[..., gymnasium.Env[Any, Any]]
GivesEnv = gymnasium.Env[Any, Any] | MakeGym
"""What a program can give: an environment, or a function or class that makes one."""


class GivenEnv(EnvConfig):
    """An environment that a program has given. A run folder keeps its name, not its code.

    What is not a setting is in slots, so that configs are saved without it.

    Attributes:
        maker: makes one; called with ``kwargs``.
        declared: its task; None: its own attribute ``task``.
        token: tells it from others of that name, in this and in other processes.
    """

    __slots__ = ("declared", "maker", "token")
    maker: MakeGym
    declared: Task | None
    token: str


def make_given(given: GivenEnv) -> Declared:
    """Make one, with its time limit and task.

    Raises:
        ConfigError: if it cannot be made, or the task is missing or does not fit.
    """
    try:
        made = given.maker(**given.kwargs)
    except Exception as error:  # user code may raise anything
        raise ConfigError(f"env={given.id}: it cannot be made ({raised(error)})") from None
    if not isinstance(made, gymnasium.Env):
        raise ConfigError(f"env={given.id}: it made {type(made).__name__}; allowed is a gymnasium environment")
    task = given.declared or (made.get_wrapper_attr("task") if made.has_wrapper_attr("task") else None)
    if not isinstance(task, Task):
        raise ConfigError(
            f"env={given.id}: it declares no task; allowed is task=Task(...), or an attribute task of that type"
        )
    sense = Sense(made, task.state, task.observes)
    size = sense.states(made)
    for part in ("state_names", "state_units"):
        if len(getattr(task, part)) != size:
            raise ConfigError(
                f"task.{part}={list(getattr(task, part))} with env={given.id}: allowed are {size}, one for each "
                "number of the state"
            )
    limit = made.spec.max_episode_steps if made.spec is not None else None
    limited = made if limit == task.max_episode_steps else TimeLimit(made, task.max_episode_steps)
    return Declared(limited, sense.named(task), again=(given.token, partial(make_given, given)), sense=sense)
