"""Take an environment from a Python program: name it, try it, and check that its task fits."""

from __future__ import annotations

from functools import partial
from typing import Any
from uuid import uuid4

import cloudpickle
import gymnasium

from ibe_rl.envs.declare import check_functions
from ibe_rl.envs.functions import CHECKS, name_of
from ibe_rl.envs.given import GivenEnv, GivesEnv, MakeGym, make_given
from ibe_rl.runtime.printed import raised
from ibe_rl.task import Task
from ibe_rl.types import ConfigError


def given_env(env: GivesEnv, task: Task | None = None, name: str | None = None) -> GivenEnv:
    """Take an environment from a program, and try it once.

    Args:
        env: a function or class that makes one, or an environment, which is copied and itself left alone.
        task: what it declares; None: its own attribute ``task``.
        name: kept in run folders; None: that of the function or class.

    Raises:
        ConfigError: if it cannot be made or copied, or the task does not fit.
    """
    known = name or name_of(env)
    given = GivenEnv(id=known, given=True)
    given.maker = _copies(env, known) if isinstance(env, gymnasium.Env) else env
    given.declared, given.token = task, uuid4().hex
    if not callable(given.maker):
        raise ConfigError(
            f"env={env!r:.80}: allowed is a name, a function or class that makes an environment, or an environment"
        )
    made = make_given(given)
    own: Task = made.task
    check_functions(made, own, [part for part in CHECKS if getattr(own, part) is not None])
    return given


def _copies(env: gymnasium.Env[Any, Any], name: str) -> MakeGym:
    """Make copies of an environment as it is now."""
    try:
        kept = cloudpickle.dumps(env)
        cloudpickle.loads(kept)
    except Exception as error:  # pickling may raise anything
        raise ConfigError(
            f"env={name}: this object cannot be copied ({raised(error)}); allowed is a function that makes one"
        ) from None
    return partial(cloudpickle.loads, kept)
