"""Export a run's log as a dataset of Minari, without loss."""

from __future__ import annotations

import os
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ibe_rl.apps.datasets.instruction_source import GIVEN, INSTRUCTION
from ibe_rl.apps.datasets.optional import load_minari
from ibe_rl.apps.datasets.recorded import DATASET_PERCEPT, DATASET_SUCCESS
from ibe_rl.apps.external.folder import SEEDS
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.ibe.vocabulary import phrases_of
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import CONFIG, TRAJECTORIES, find_run, read_json, refuse_special_files
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Episode
from ibe_rl.vocabulary.words import take_up_words

DATASETS_PATH = "MINARI_DATASETS_PATH"
_CONTEXT, _WORDS = "context", "instruction_words"
"""Keys of the infos beside those of ``instruction_source``, of ``T + 1`` rows; the final state has no instruction."""


def export_log(run: str | Path, dataset_id: str, newest: int | None = None) -> Any:
    """Make a dataset of the episodes in a run's log, without loss.

    Args:
        run: the folder of the run.
        dataset_id: in Minari's form, ``mine/log-v0``.
        newest: export only so many of the newest episodes; None: all.

    Returns:
        the ``MinariDataset``.

    Raises:
        ConfigError: if the run has no log, or the dataset exists already.
    """
    minari, folder = load_minari(), find_run(str(run), Path("runs"))
    refuse_special_files(folder)
    config: TrainConfig = load_config(folder / CONFIG, TrainConfig)
    if newest is not None and newest < 1:
        raise ConfigError(f"newest={newest}: allowed is at least 1")
    try:
        log = TrajectoryLog.open(folder / TRAJECTORIES)
    except ValueError as error:
        raise ConfigError(f"run={folder}: {error}") from None
    count = len(log.index)
    if not count:
        raise ConfigError(f"run={folder}: no episode has ended in its log; allowed is one with episodes")
    chosen = range(max(0, count - (newest or count)), count)
    env, seeds = make_env(config.env), _seeds(folder, count)
    task = task_of(env)
    take_up_words(folder, task)
    buffers = [_buffer(minari, log.read([row], percepts=True)[0], task, seeds[row]) for row in chosen]
    about = {"algorithm_name": config.agent.kind, "author": "ibe_rl", "description": _description(task)}
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
    spec = env.unwrapped.spec  # without our wrapper, which Minari could not rebuild
    return _created(minari, dataset_id, buffers, {"env": spec, "data_format": "hdf5", **spaces, **about})


def _created(minari: Any, dataset_id: str, buffers: list[Any], about: dict[str, Any]) -> Any:
    """Create a dataset; it gets its name once it is whole, also if this program is killed."""
    path_of = import_module("minari.storage").get_dataset_path
    place, every = Path(path_of(dataset_id)), Path(path_of())
    if place.exists():
        raise ConfigError(f"dataset={dataset_id}: {place} already exists; allowed is a new name")
    try:
        with TemporaryDirectory(prefix=".ibe_rl_", dir=every) as hidden:  # Minari lists no hidden folders
            with _datasets_in(hidden), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about the missing code link and e-mail
                minari.create_dataset_from_buffers(dataset_id, buffers, **about)
            _move_to(place, Path(hidden, dataset_id))
        return minari.load_dataset(dataset_id)
    except (ValueError, TypeError, OSError) as error:
        raise ConfigError(f"dataset={dataset_id}: {error}") from None


def _move_to(place: Path, made: Path) -> None:
    """Move a dataset, and copy what describes its namespace if that is new."""
    place.parent.mkdir(parents=True, exist_ok=True)
    for file in made.parent.iterdir():
        if file.is_file() and not (place.parent / file.name).exists():
            shutil.copy(file, place.parent)
    made.rename(place)


@contextmanager
def _datasets_in(folder: str) -> Iterator[None]:
    before = os.environ.get(DATASETS_PATH)
    os.environ[DATASETS_PATH] = folder
    try:
        yield
    finally:
        del os.environ[DATASETS_PATH]
        if before is not None:
            os.environ[DATASETS_PATH] = before


def _seeds(folder: Path, count: int) -> list[int | None]:
    """The seeds of the episodes in a log, where its folder knows them."""
    try:
        found = read_json(folder / SEEDS)["seeds"]
        seeds = [None if seed is None else int(seed) for seed in found]
    except FileNotFoundError:
        return [None] * count
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{folder / SEEDS}: not readable seeds ({error!r:.200})") from None
    return seeds if len(seeds) == count else [None] * count


def _description(task: Task) -> str:
    return (
        f"{task.name} with instructions: infos[{INSTRUCTION!r}] is the instruction, infos[{GIVEN!r}] whether "
        f"there was one, infos[{DATASET_SUCCESS!r}] whether the episode ended well, infos[{_CONTEXT!r}] what it was "
        f"about, infos[{_WORDS!r}] the instruction in words."
    )


def _buffer(minari: Any, episode: Episode, task: Task, seed: int | None) -> Any:
    steps = len(episode)
    last = np.arange(steps) == steps - 1
    silence = np.zeros_like(episode.instructions[:1])
    words = np.where(episode.given, phrases_of(episode.instructions, task.phrases), "")
    infos = {
        INSTRUCTION: np.concatenate([episode.instructions, silence]),
        GIVEN: np.append(np.asarray(episode.given, bool), False),
        DATASET_SUCCESS: np.append(False, last & episode.success),
        _CONTEXT: np.full(steps + 1, episode.context.encode()),
        _WORDS: np.char.encode(np.append(words, ""), "utf-8"),
    }
    if episode.percepts is not None:
        infos[DATASET_PERCEPT] = episode.percepts
    return minari.data_collector.EpisodeBuffer(
        seed=seed,
        observations=episode.states,
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=last & episode.terminated,
        truncations=last & (not episode.terminated),
        infos=infos,
    )
