"""The settings of a training, from values, classes and environments of a user's own program."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from functools import partial
from typing import Any

import gymnasium

from ibe_rl.config.arguments import quoted
from ibe_rl.config.command_line import composed
from ibe_rl.config.hydra_setup import choice_names
from ibe_rl.config.kinds import check_config
from ibe_rl.config.overrides import KINDS_OF_ONE, as_overrides, chosen_kind
from ibe_rl.config.settings import EnvConfig, TrainConfig
from ibe_rl.envs.given import GivenEnv, GivesEnv
from ibe_rl.envs.giving import given_env
from ibe_rl.runtime.import_string import import_from_here
from ibe_rl.runtime.printed import raised
from ibe_rl.task import Task
from ibe_rl.types import ConfigError


def settings(
    *overrides: str, env: str | GivesEnv | None = None, task: Task | None = None, **values: Any
) -> TrainConfig:
    """Compose and check the settings of a training, as ``train.py`` does from its command line.

    Settings of a kind of your own are a class, ``{"kind": "my_package.my_module:MyMapping", ...}`` or an object of its
    settings: ``mapping=MyMapping``. ``{"n_clusters": 5}`` without a kind changes the default's.

    Args:
        overrides: as on the command line, such as ``"collect.processes=1"``.
        env: the name of a file in ``configs/env``, a gymnasium id, a function or class that makes an environment, or
            an environment, which is copied; None: the default. The program has to give it again to open the run.
        task: what the environment declares; None: its own attribute ``task``.
        values: settings by name: ``total_frames=200_000``, ``viewer="off"``, ``collect={"processes": 1}``.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    chosen, given = environment(env, task)
    kinds = {group: chosen_kind(group, values.pop(group)) for group in KINDS_OF_ONE if _is_kind(values.get(group))}
    config: TrainConfig = composed("train", [*chosen, *overrides, *as_overrides(values)])
    if config.resume is not None:
        raise ConfigError(f"resume={config.resume}: allowed in Python is ibe_rl.resume({config.resume!r})")
    config = replace(config, **kinds, env=given or config.env)
    check_config(config)
    return config


def _is_kind(choice: Any) -> bool:
    if isinstance(choice, Mapping):
        return "kind" in choice
    return inspect.isclass(choice) or is_dataclass(choice)


def environment(env: str | GivesEnv | None, task: Task | None = None) -> tuple[list[str], GivenEnv | None]:
    """An environment as settings of ``train.py``, and itself if it is no more than that.

    Raises:
        ConfigError: if there is none, or the task is missing, superfluous or does not fit.
    """
    if env is None or (isinstance(env, str) and env in (names := choice_names("env"))):
        if task is not None:
            raise ConfigError(f"task={task.name} with env={env}: allowed with it is a gymnasium id or a function")
        return ([] if env is None else [f"env={env}"]), None
    if not isinstance(env, str):
        given = given_env(env, task)
    else:
        _check_known(env, names)
        if task is None:
            return ["env=schema", f"env.id={quoted(env)}"], None
        given = given_env(partial(gymnasium.make, env, disable_env_checker=True), task, name=env)
    return ["env=schema", f"env.id={quoted(given.id)}", "env.given=true"], given


def _check_known(env_id: str, names: list[str]) -> None:
    module, colon, name = env_id.rpartition(":")
    reason = ""
    if colon:
        try:
            import_from_here(module)
        except Exception as error:  # user code may raise anything
            reason = f" ({module}: {raised(error)})"
    if name not in gymnasium.registry:
        raise ConfigError(
            f"env={env_id}: allowed is one of {', '.join(names)}, an id that is registered with gymnasium{reason}, "
            "a function that makes an environment, or an environment"
        )


def env_config(env: str | GivesEnv | None, task: Task | None = None) -> EnvConfig | None:
    """The settings of an environment that a program gives; None if it gives none.

    Raises:
        ConfigError: as ``environment``.
    """
    chosen, given = environment(env, task)
    if env is None:
        return None
    found: EnvConfig = given or composed("train", chosen).env
    return found
