"""The task that a config declares for an environment without one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.config.settings import CODE_SETTINGS, TaskConfig
from ibe_rl.config.task_parts import MirrorConfig, PhrasesConfig
from ibe_rl.envs.functions import CHECKS, checked_success, with_checks
from ibe_rl.envs.sensing import Sense
from ibe_rl.envs.wrappers import SUCCESS, Declared
from ibe_rl.runtime.import_string import import_named
from ibe_rl.task import DEGREES, Phrases, Task
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import Array, ConfigError

ANY = "any"
"""The context if none is declared."""

SHAPE_FUNCTIONS = ("background", "figure")


def load_function(key: str, name: str) -> Callable[..., Any]:
    """The function, or an instance of the class, that ``module:name`` names.

    Raises:
        ConfigError: if it is missing or not callable; ``key`` is the setting.
    """
    found = import_named(key, name, "module:function or module:class", made=True)
    if not callable(found):
        raise ConfigError(f"{key}={name}: allowed is what can be called, this is {type(found).__name__}")
    called: Callable[..., Any] = found
    return called


def declare(env: gymnasium.Env[Any, Any], config: TaskConfig) -> Declared:
    """Wrap an environment with a declared task.

    Args:
        env: observes any space.
        config: the declared task.

    Raises:
        ConfigError: naming the setting, its value and what is allowed.
    """
    made: dict[str, Callable[..., Any]] = {
        name: load_function(f"env.task.{name}", getattr(config, name))
        for name in CODE_SETTINGS
        if getattr(config, name)
    }
    task = _task(env, config, made)
    named = {name: getattr(config, name) or "" for name in CHECKS}
    task = with_checks(task, named, "env.task")
    success = checked_success(made.get("success"), config.success, task)
    draw = {part: made[part] for part in SHAPE_FUNCTIONS if part in made}
    declared = Declared(env, task, success, draw)
    check_functions(declared, task, [name for name, text in named.items() if text])
    return declared


def _task(env: gymnasium.Env[Any, Any], config: TaskConfig, functions: dict[str, Callable[..., Any]]) -> Task:
    size = Sense(env, functions.get("state"), config.observes).states(env)
    names = _names("state_names", config.state_names or [f"state_{i}" for i in range(size)], size)
    units = _names("state_units", config.state_units or [""] * size, size, distinct=False)
    unknown = [name for name in config.explained if name not in names]
    if unknown or len(config.explained) != len(config.phrases) or not config.explained:
        raise ConfigError(
            f"env.task.explained={config.explained}: allowed are {len(config.phrases)} of {', '.join(names)}, one for "
            "each entry of env.task.phrases"
        )
    for key in ("explained_band", "explained_range"):
        numbers = getattr(config, key)
        if (numbers or key == "explained_band") and (len(numbers) != len(config.explained) or min(numbers) <= 0):
            raise ConfigError(f"env.task.{key}={numbers}: allowed are {len(config.explained)} numbers above 0")
    contexts = config.contexts or [ANY]
    if bool(config.contexts) != bool(config.context):
        raise ConfigError(
            f"env.task.context={config.context} with env.task.contexts={config.contexts}: allowed is both or neither"
        )
    return Task(
        name=config.name,
        state_names=names,
        state_units=units,
        rule=functions["rule"],
        instruction_values=tuple(sorted(config.instruction_values)),
        phrases=tuple(_phrases(one) for one in config.phrases),
        context=functions.get("context", _anything),
        contexts=tuple(contexts),
        context_option=config.context_option or "",
        success_key=SUCCESS if config.success else config.success_key or SUCCESS,
        judges_success=bool(config.success or config.success_key),
        explained=tuple(names.index(name) for name in config.explained),
        explained_band=tuple(config.explained_band),
        explained_range=tuple(config.explained_range),
        max_episode_steps=_steps(env, config),
        motion=functions.get("motion"),
        goal_offset=functions.get("goal_offset"),
        first_contact=functions.get("first_contact"),
        scene_path=functions.get("scene_path"),
        state=functions.get("state"),
        observes=tuple(config.observes),
        hidden_goal=dict(config.hidden_goal),
        mirror=_mirror(config.mirror, names, len(config.phrases)) if config.mirror else None,
        scene_size=(float(config.scene_size[0]), float(config.scene_size[1])),
    )


def _mirror(config: MirrorConfig, names: Sequence[str], instruction_size: int) -> Mirror:
    if any(len(pair) != 2 for pair in config.swapped):
        raise ConfigError(f"env.task.mirror.swapped={config.swapped}: allowed are pairs of state names")
    try:
        mirror = Mirror(
            flipped=tuple(config.flipped),
            swapped=tuple((one, other) for one, other in config.swapped),
            instruction=tuple(config.instruction),
            actions=tuple(config.actions),
            action_signs=tuple(config.action_signs),
        )
        mirror.check(names, instruction_size)
    except ValueError as error:
        raise ConfigError(f"env.task.mirror={vars(config)}: {error}") from None
    return mirror


def _anything(_: Array) -> str:
    return ANY


def _id(env: gymnasium.Env[Any, Any]) -> str:
    return env.spec.id if env.spec is not None else type(env.unwrapped).__name__


def _names(key: str, names: Sequence[str], size: int, distinct: bool = True) -> tuple[str, ...]:
    if len(names) != size or (distinct and len(set(names)) != size):
        raise ConfigError(
            f"env.task.{key}={list(names)}: allowed are {size}{' different' if distinct else ''} names, "
            "one for each number of the state"
        )
    return tuple(names)


def _phrases(config: PhrasesConfig) -> Phrases:
    degrees = tuple((limit, f"{word} " if word else "") for word, limit in config.degrees.items())
    try:  # a file's degrees are no default of the setting: they would be merged with it
        return Phrases(config.zero, config.negative, config.positive, degrees or DEGREES)
    except ValueError as error:
        raise ConfigError(f"env.task.phrases: {error}") from None


def _steps(env: gymnasium.Env[Any, Any], config: TaskConfig) -> int:
    registered = env.spec.max_episode_steps if env.spec is not None else None
    if registered is None:
        raise ConfigError(
            f"env.task.max_episode_steps={config.max_episode_steps}: {_id(env)} is registered without a time limit, "
            "so this has to say how many steps an episode has at most"
        )
    return int(registered)


def check_functions(env: gymnasium.Env[Any, Any], task: Task, named: Iterable[str]) -> None:
    """Call the functions of a task with a first state, so that their errors appear before training.

    Args:
        env: is reset.
        task: of the environment, with checked functions.
        named: the functions to call; ``first_contact``, which reads whole episodes, is not.

    Raises:
        ConfigError: naming the function, what it gave and what is allowed.
    """
    state = np.asarray(env.reset(seed=0)[0], np.float32)
    for name in set(named) - {"first_contact"}:
        getattr(task, name)(state if name == "context" else np.stack([state, state]))
