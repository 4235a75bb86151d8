"""Import a dataset, of Minari or of arrays in a file, as a run folder with the vocabulary learnt from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.apps.datasets.arrays import SUFFIXES, Arrays
from ibe_rl.apps.datasets.instruction_source import InstructionSource, instructed_size
from ibe_rl.apps.datasets.optional import load_minari
from ibe_rl.apps.datasets.recorded import DATASET_PERCEPT, Conversion, RawEpisode
from ibe_rl.apps.external.actions import check_same_actions
from ibe_rl.apps.external.folder import external_run_config, keep_run, print_lines
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import EnvConfig
from ibe_rl.envs.declare import load_function
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.runtime.printed import raised
from ibe_rl.storage.run_folder import refuse_used
from ibe_rl.storage.whole_folder import whole_folder
from ibe_rl.task import Task
from ibe_rl.types import ConfigError

FEWEST_EPISODES = 2
STEPS_ELSEWHERE = 10
StateOf = Callable[[Any], Any]
"""One observation to the state."""


@dataclass(frozen=True)
class Source:
    """A data set.

    Attributes:
        where: for messages.
        episodes: all of them, each time from the first.
        rows: states in all episodes, final ones included.
        count: episodes.
        spaces: what declares ``observation_space`` and ``action_space``; None: nothing.
    """

    where: str
    episodes: Callable[[], Iterator[RawEpisode]]
    rows: int
    count: int
    spaces: Any = None


def import_log(
    dataset_id: str, settings: Sequence[str] = (), instruction: str | None = None, state: str | None = None
) -> Path:
    """Make a run folder of a dataset, with the vocabulary learnt from its episodes.

    Args:
        dataset_id: the name of a local dataset of Minari, or a file of arrays (``.npz``, ``.hdf5``).
        settings: of ``explain.py``: ``env=…`` of its states, ``run_dir=…``, ``mapping=…``.
        instruction: the key of the infos that holds it; "rule" asks the environment's own rule in each state. None
            takes ``"instruction"`` of the infos, else that in the observations, else the rule.
        state: ``module:name`` of a function of one observation to the state ``(S,)``; None: that of the environment
            (``env.task.state``), or they are the same.

    Returns:
        the folder; ``explain.py run=FOLDER agent=…`` explains an agent with its vocabulary.

    Raises:
        ConfigError: if it does not fit the environment, or no vocabulary can be learnt.
    """
    cfg = composed("explain", settings)
    path = Path(cfg.run_dir)
    refuse_used(path)
    source = _of_file(Path(dataset_id)) if Path(dataset_id).suffix in SUFFIXES else _of_minari(dataset_id)
    config = external_run_config(cfg, f"the agent of the dataset {dataset_id}", seed=0)
    env = make_env(config.env)
    first = next(source.episodes(), None)
    function = declared_state(env, config.env, first) if state is None else load_function("--state", state)
    _check_spaces(source, env, task_of(env), function is None)
    convert = _conversion(source, first, env, config.env, instruction, function)
    with whole_folder(path) as folder:
        episodes = (convert(one) for one in source.episodes())
        keep_run(folder, config, episodes, source.rows, seeds=convert.seeds)
    print_lines(*_notes(convert))
    return path


def declared_state(env: gymnasium.Env[Any, Any], config: EnvConfig, first: RawEpisode | None) -> StateOf | None:
    """The environment's own function of one observation; None if the recorded observations are its states."""
    task, space = task_of(env), env.unwrapped.observation_space
    if not task.parts or first is None or DATASET_PERCEPT in first.infos:
        return None
    shape = () if isinstance(first.observations, Mapping | tuple) else np.shape(first.observations)[1:]
    if shape in ((len(task.state_names),), (instructed_size(task),)) and shape != space.shape:
        return None
    sense, other = env.get_wrapper_attr("sense"), _elsewhere(config)

    def state(observation: Any) -> Any:
        try:
            found, again = (sense(one.unwrapped, observation)[0] for one in (env, other))
        except ConfigError:
            raise
        except Exception as error:  # code of the user may raise anything
            raise ConfigError(
                f"env.task.state: it raised {raised(error)} for a recorded observation; allowed is an observation of "
                "the environment, or --state=MODULE:NAME, one observation to the state"
            ) from None
        if not np.array_equal(found, again):
            raise ConfigError(
                "env.task.state: it reads the environment, which a dataset does not have; allowed is "
                "--state=MODULE:NAME, one observation to the state"
            )
        return found

    env.reset(seed=0)
    return state


def _elsewhere(config: EnvConfig) -> gymnasium.Env[Any, Any]:
    """Another environment of the same kind, in the middle of another episode."""
    env = make_env(config)
    env.reset(seed=1)
    env.action_space.seed(1)
    for _ in range(STEPS_ELSEWHERE):
        if any(env.step(env.action_space.sample())[2:4]):
            env.reset(seed=2)
    return env


def _conversion(
    source: Source,
    first: RawEpisode | None,
    env: gymnasium.Env[Any, Any],
    config: EnvConfig,
    key: str | None,
    state: StateOf | None,
) -> Conversion:
    """How its episodes are converted, tried with the first one."""
    task = task_of(env)
    if first is None:
        raise ConfigError(f"{source.where}: it has no episode; allowed are at least {FEWEST_EPISODES}")
    if source.count < FEWEST_EPISODES:
        raise ConfigError(f"{source.where}: it has {source.count} episode; allowed are at least {FEWEST_EPISODES}")
    instruction_source = InstructionSource.found(task, key, first, state is None)
    declared = config.task.success if config.task is not None else None
    succeeded = load_function("env.task.success", declared) if declared else None
    convert = Conversion(task, env.action_space, instruction_source, state, succeeded)
    replace(convert, seeds=[])(first)
    return convert


def _notes(done: Conversion) -> list[str]:
    episodes, notes = len(done.seeds), []
    if done.without_success and done.task.judges_success:
        counted = f"{done.without_success:,} of {episodes:,} episodes"
        notes.append(f"note: {counted} have no info that says whether they succeeded; they count as failures")
    if done.without_end:
        notes.append(f"note: {done.without_end:,} of {episodes:,} episodes have no end; they count as truncated")
    return notes


def _of_file(path: Path) -> Source:
    arrays = Arrays.read(path)
    cuts = arrays.cuts
    return Source(arrays.where, arrays.episodes, int(cuts[-1]) + len(cuts), len(cuts) - 1)


def _of_minari(dataset_id: str) -> Source:
    where = f"dataset={dataset_id}"
    minari = load_minari()
    try:
        dataset = minari.load_dataset(dataset_id)
    except FileNotFoundError:
        raise ConfigError(
            f"{where}: no dataset of Minari on this machine has that name; allowed is one of `minari list local`, or a "
            f"file of arrays, {', '.join(SUFFIXES)}"
        ) from None
    except Exception as error:  # a damaged dataset may raise anything
        raise ConfigError(f"{where}: it cannot be read ({raised(error)})") from None

    def episodes() -> Iterator[RawEpisode]:
        for number in dataset.episode_indices.tolist():
            at = f"{where}, episode {number}"
            try:
                (data,), (known,) = dataset.iterate_episodes([number]), dataset.storage.get_episode_metadata([number])
            except Exception as error:  # a damaged file may raise anything
                raise ConfigError(f"{at}: it cannot be read ({raised(error)})") from None
            yield _recorded(at, data, known)

    return Source(where, episodes, dataset.total_steps + dataset.total_episodes, dataset.total_episodes, dataset)


def _recorded(where: str, data: Any, known: Mapping[str, Any]) -> RawEpisode:
    return RawEpisode(
        where,
        data.observations,
        data.actions,
        data.rewards,
        data.terminations,
        data.truncations,
        data.infos or {},
        known.get("seed"),
    )


def _check_spaces(source: Source, env: gymnasium.Env[Any, Any], task: Task, plain: bool) -> None:
    check_same_actions(source.where, source.spaces, env.action_space)
    space = getattr(source.spaces, "observation_space", None)
    allowed = (len(task.state_names),), (instructed_size(task),)
    if plain and space is not None and space.shape not in allowed:
        kind = f"of shape {space.shape}" if isinstance(space, gymnasium.spaces.Box) else f"{space!s:.200}"
        raise ConfigError(
            f"{source.where}: its observations are {kind}; allowed is {allowed[0]}, the state, or {allowed[1]} with "
            "the instruction and whether it was given; or --state=MODULE:NAME, one observation to the state"
        )
