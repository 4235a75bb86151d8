"""The task that a config declares for an environment without one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.config.settings import CODE_SETTINGS, PhrasesConfig, TaskConfig
from ibe_rl.envs.sensing import Sense
from ibe_rl.envs.wrappers import SUCCESS, Declared
from ibe_rl.runtime.import_string import import_named, raised
from ibe_rl.task import Phrases, Task
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
    sense = Sense(env, made.get("state"), config.observes)
    task = sense.named(_task(env, config, made, sense.states(env)))
    named = {name: getattr(config, name) for name in ("rule", "motion", "goal_offset", "scene_path", "context")}
    draw = {part: made[part] for part in SHAPE_FUNCTIONS if part in made}
    declared = Declared(env, task, made.get("success"), draw, sense=sense)
    check_functions(declared, task, {name: text for name, text in named.items() if text}, "env.task")
    return declared


def _task(
    env: gymnasium.Env[Any, Any], config: TaskConfig, functions: dict[str, Callable[..., Any]], size: int
) -> Task:
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
        scene_size=(float(config.scene_size[0]), float(config.scene_size[1])),
    )


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
    limits = list(config.degrees.values())
    if limits != sorted(limits) or not limits:
        raise ConfigError(f"env.task.phrases: degrees={dict(config.degrees)}: allowed are rising limits, at least one")
    degrees = tuple((limit, f"{word} " if word else "") for word, limit in config.degrees.items())
    try:
        for words in (config.negative, config.positive):
            words.format(degree="")
    except (KeyError, IndexError, ValueError):
        raise ConfigError(f"env.task.phrases: {words!r}: allowed in braces is {{degree}} only") from None
    return Phrases(config.zero, config.negative, config.positive, degrees)


def _steps(env: gymnasium.Env[Any, Any], config: TaskConfig) -> int:
    registered = env.spec.max_episode_steps if env.spec is not None else None
    if registered is None:
        raise ConfigError(
            f"env.task.max_episode_steps={config.max_episode_steps}: {_id(env)} is registered without a time limit, "
            "so this has to say how many steps an episode has at most"
        )
    return int(registered)


def check_functions(env: gymnasium.Env[Any, Any], task: Task, named: Mapping[str, str], key: str) -> None:
    """Call the functions of a task with a first state, so that their errors appear before training.

    Args:
        env: is reset.
        task: of the environment.
        named: the functions to call, with their names for the errors; always with ``rule``.
        key: where they were declared.

    Raises:
        ConfigError: naming the function, what it gave and what is allowed.
    """
    state = np.asarray(env.reset(seed=0)[0], np.float32)
    several, size = np.stack([state, state]), task.instruction_size
    shapes = {"rule": (2, size), "motion": (2, size), "goal_offset": (2, size), "scene_path": (2, 2)}

    def call(name: str, given: Array) -> Any:
        try:
            return getattr(task, name)(given)
        except Exception as error:  # user code may raise anything
            raise ConfigError(f"{key}.{name}={named[name]}: it raised {raised(error)}") from None

    for name in [name for name in shapes if name in named]:
        got = np.shape(call(name, several))
        if got != shapes[name]:
            raise ConfigError(
                f"{key}.{name}={named[name]}: for 2 states it gave an array of shape {got}; allowed is {shapes[name]}"
            )
    said = np.asarray(task.rule(several))
    if not np.all(np.abs(said) <= 1):
        raise ConfigError(f"{key}.rule={named['rule']}: it returned {said[0].tolist()}; allowed is -1 to 1")
    if "context" in named and (about := call("context", state)) not in task.contexts:
        raise ConfigError(
            f"{key}.context={named['context']}: it returned {about!r}; allowed is one of {', '.join(task.contexts)}"
        )
