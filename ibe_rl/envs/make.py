"""Make gymnasium environments with their task, behind their gate."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import gymnasium

from ibe_rl.config.kinds import checked, maker_of_env, settings_of_env
from ibe_rl.config.settings import EnvConfig, TaskConfig
from ibe_rl.envs.declare import declare
from ibe_rl.envs.errors import CopyError
from ibe_rl.envs.gate import Gate
from ibe_rl.envs.given import GivenEnv, make_given
from ibe_rl.envs.own_task import with_own_task
from ibe_rl.envs.sensing import Sensed
from ibe_rl.envs.snapshots import Stoppable, stoppable
from ibe_rl.envs.worded import worded
from ibe_rl.envs.wrappers import Declared, task_of
from ibe_rl.runtime.import_string import import_from_here
from ibe_rl.types import ConfigError

ENVIRONMENT_PACKAGES = ("gymnasium_robotics", "highway_env", "minigrid")
"""Modules that the extra ``environments`` installs."""


def make_gym(env_id: str, kwargs: Mapping[str, Any], declared: TaskConfig | None = None) -> gymnasium.Env[Any, Any]:
    """Make one environment, with its time limit.

    Args:
        env_id: gymnasium id; ``module:id`` imports the module first.
        kwargs: of its constructor.
        declared: task from a config; None: the environment has a ``task``.

    Raises:
        ConfigError: if ``env_id`` is not registered or cannot be made, or the task is missing or does not fit.
    """
    _check_registered(env_id)
    limit = (
        {}
        if declared is None or declared.max_episode_steps is None
        else {"max_episode_steps": declared.max_episode_steps}
    )
    try:
        env = gymnasium.make(env_id, disable_env_checker=True, **limit, **_checked(env_id, kwargs))
    except ConfigError:
        raise
    except (TypeError, ValueError, AssertionError, ImportError, gymnasium.error.Error) as error:
        raise ConfigError(f"env.id={env_id} with env.kwargs={dict(kwargs)}: {' '.join(str(error).split())}") from None
    label = f"env.id={env_id}"
    if declared is not None:
        key, names = None if declared.success else declared.success_key, declared.state_names or ()
        return declare(Gate(env, label, key, () if declared.state else names), declared)
    return with_own_task(env, label)


def _checked(env_id: str, kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """Check the arguments and add defaults if the environment's class has a dataclass ``settings``."""
    settings = settings_of_env(env_id)
    if settings is None:
        _check_flags(env_id, kwargs)
        return dict(kwargs)
    return dict(vars(checked(settings, kwargs, "env.kwargs")))


def _check_flags(env_id: str, kwargs: Mapping[str, Any]) -> None:
    """Refuse what is no bool where the environment declares ``bool``: any text would count as true."""
    try:
        declared = inspect.signature(maker_of_env(env_id)).parameters
    except (TypeError, ValueError):  # it has no signature
        return
    for key, value in kwargs.items():
        one = declared.get(key)
        if one and one.annotation in (bool, "bool") and value not in (False, True, one.default):
            raise ConfigError(f"env.kwargs.{key}={value}: {env_id} declares a bool; allowed are true and false")


def _check_registered(env_id: str) -> None:
    module, colon, name = env_id.rpartition(":")
    if colon:
        try:
            import_from_here(module)
        except Exception as error:
            missing = isinstance(error, ImportError) and error.name in ENVIRONMENT_PACKAGES
            rather = "; install the extra ibe_rl[environments]" if missing else ""
            raise ConfigError(f"env.id={env_id}: {module} cannot be imported ({error}){rather}") from None
    if name not in gymnasium.registry:
        ours = ", ".join(known for known in gymnasium.registry if known.startswith("ibe_rl/"))
        raise ConfigError(f"env.id={env_id}: not registered with gymnasium; of ours allowed are {ours}")


def make_env(env: EnvConfig) -> gymnasium.Env[Any, Any]:
    """``make_gym`` from the settings of an environment, or one that a program has given.

    Raises:
        ConfigError: as ``make_gym``; or if nobody has given it.
    """
    made = _without_words(env)
    task = task_of(made)
    if env.words or env.max_words is not None or task.words is not None:
        made.task = worded(task, env.words, env.max_words)  # type: ignore[attr-defined]  # the outermost one is read
    return made


def _without_words(env: EnvConfig) -> gymnasium.Env[Any, Any]:
    """As it declares its task itself."""
    if isinstance(env, GivenEnv):
        return make_given(env)
    if env.given:
        raise ConfigError(f"env.given=true with env.id={env.id}: allowed only in Python, as ibe_rl.settings(env=...)")
    return make_gym(env.id, env.kwargs, env.task)


def make_snapshot_env(env: EnvConfig) -> Stoppable:
    """Make one environment to predict in.

    Raises:
        CopyError: if it cannot be restored exactly.
    """
    original = make_env(env)
    made = stoppable(original)
    if made is None:
        raise CopyError(
            env.id,
            "the state of this environment cannot be saved and restored exactly (it has no snapshot() and restore(), "
            "and a deep copy of it behaves differently)",
        )
    if isinstance(original, Declared) and not original.sense.as_it_is:
        return Sensed(made, original.sense)
    return made
