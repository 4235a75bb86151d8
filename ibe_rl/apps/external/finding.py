"""Find an agent by its name, and what its own training put between it and the environment.

A file of stable-baselines3, and that of ``VecNormalize``, are pickles: loading them runs code from them. They are
loaded only if the user names them, never because a run folder does.
"""

from __future__ import annotations

import importlib
import inspect
import json
import pickle
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

from ibe_rl.apps.external.adapters import KeyStatistics, Statistics
from ibe_rl.runtime.import_string import import_named
from ibe_rl.runtime.printed import raised
from ibe_rl.types import ConfigError

SB3_KINDS = {
    "MaskablePPO": ("sb3_contrib.common.maskable", "sb3_contrib"),
    "RecurrentPPO": ("sb3_contrib.common.recurrent", "sb3_contrib"),
    "QRDQN": ("n_quantiles", "sb3_contrib"),
    "CrossQ": ("sb3_contrib.crossq", "sb3_contrib"),
    "ARS": ("delta_std_schedule", "sb3_contrib"),
    "TRPO": ("cg_max_steps", "sb3_contrib"),
    "TQC": ("top_quantiles_to_drop_per_net", "sb3_contrib"),
    "DQN": ("exploration_fraction", "stable_baselines3"),
    "SAC": ("target_entropy", "stable_baselines3"),
    "TD3": ("policy_delay", "stable_baselines3"),
    "PPO": ("clip_range", "stable_baselines3"),
    "A2C": ("gae_lambda", "stable_baselines3"),
}
"""What identifies each algorithm in a saved file, a setting or the package of its classes; the first match counts."""
FOR_READING: dict[str, Any] = {"buffer_size": 1, "replay_buffer_class": None, "replay_buffer_kwargs": {}}
"""Settings of a loaded model: it replays nothing, and a replay of goals would ask for an environment."""
ALLOWED = "a .zip of stable-baselines3, or MODULE:NAME of a policy that Python can import"


def find_agent(name: str) -> Any:
    """Load the agent of that name. Loading runs code from the file, as in that library.

    Args:
        name: a ``.zip`` of stable-baselines3 or sb3-contrib, or ``module:name``.

    Raises:
        ConfigError: if there is none, or the library for it is missing.
    """
    if name.endswith(".zip"):
        return _load_sb3(Path(name))
    _, colon, attribute = name.partition(":")
    if not colon or not attribute:
        weights = " (it may hold weights only: name a function that loads them)" if Path(name).is_file() else ""
        raise ConfigError(f"agent={name}: allowed is {ALLOWED}{weights}")
    return import_named("agent", name, ALLOWED)


def made_without_arguments(agent: Any) -> Any:
    """What a function or class without arguments makes, for it cannot be an agent itself; any other agent unchanged.

    Raises:
        ConfigError: if it raises anything.
    """
    if not (inspect.isclass(agent) or (inspect.isfunction(agent) and not inspect.signature(agent).parameters)):
        return agent
    try:
        return agent()
    except Exception as error:  # code of the user may raise anything
        raise ConfigError(
            f"agent={agent.__name__}: it failed when called to make the agent ({raised(error)})"
        ) from None


def _load_sb3(path: Path) -> Any:
    try:
        with ZipFile(path) as archive:
            text = archive.read("data").decode()
            settings = json.loads(text)
    except (OSError, BadZipFile, KeyError, ValueError) as error:
        raise ConfigError(f"agent={path}: no readable model of stable-baselines3 ({error})") from None
    kind = next((name for name, (mark, _) in SB3_KINDS.items() if mark in _marks(settings)), None)
    if kind is None:
        raise ConfigError(f"agent={path}: allowed are {', '.join(SB3_KINDS)}, or MODULE:NAME of a loaded model")
    package = SB3_KINDS[kind][1]
    try:
        library = importlib.import_module(package)
    except ImportError:
        missing = package.replace("_", "-")
        raise ConfigError(f"agent={path}: needs {missing} for {kind}; install the extra ibe_rl[sb3]") from None
    try:
        return getattr(library, kind).load(path, device="cpu", custom_objects=dict(FOR_READING))
    except Exception as error:  # unpickling may raise anything
        raise ConfigError(f"agent={path}: {kind} cannot load it ({' '.join(str(error).split())[:200]})") from None


def _marks(settings: Any) -> set[str]:
    """The settings in a saved file, and the packages of the classes among them."""
    classes = [str(value.get("__module__")) for value in settings.values() if isinstance(value, dict)]
    packages = {".".join(one.split(".")[:size]) for one in classes for size in (2, 3)}
    return set(settings) | packages


def load_statistics(path: str) -> Statistics | KeyStatistics | None:
    """What a file of ``VecNormalize`` has learnt about observations. Loading it runs code from it.

    Returns:
        None if it does not normalise observations.

    Raises:
        ConfigError: if it is no such file, or the library for it is missing.
    """
    try:
        saved = pickle.loads(Path(path).read_bytes())  # noqa: S301 - the user names this file
    except ModuleNotFoundError as error:
        raise ConfigError(f"agent_vec_normalize={path}: {error}; install the extra ibe_rl[sb3]") from None
    except Exception as error:  # unpickling may raise anything
        raise ConfigError(f"agent_vec_normalize={path}: it cannot be read ({raised(error)})") from None
    if type(saved).__name__ != "VecNormalize":
        raise ConfigError(
            f"agent_vec_normalize={path}: it holds {type(saved).__name__}; allowed is what VecNormalize.save() wrote"
        )
    return statistics_of(saved)


def statistics_of(wrapper: Any) -> Statistics | KeyStatistics | None:
    """What a ``VecNormalize`` has learnt about observations; None if it does not normalise them."""

    def of(seen: Any) -> Statistics:
        return Statistics(seen.mean, seen.var, wrapper.epsilon, wrapper.clip_obs)

    if not wrapper.norm_obs:
        return None
    seen = wrapper.obs_rms
    return KeyStatistics({key: of(one) for key, one in seen.items()}) if isinstance(seen, dict) else of(seen)
