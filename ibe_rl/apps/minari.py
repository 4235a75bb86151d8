"""Export a run's log as a Minari dataset, and import a Minari dataset as a run folder.

python -m ibe_rl.apps.minari export runs/NAME mine/log-v0
python -m ibe_rl.apps.minari import mine/log-v0 env=NAME run_dir=runs/imported
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ibe_rl.apps.external.folder import external_run_config, keep_run
from ibe_rl.apps.external.policy import check_same_actions
from ibe_rl.config.command_line import composed
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.make import make_env, task_of
from ibe_rl.runtime.installation import typed
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import CONFIG, TRAJECTORIES, create_run_folder, find_run, refuse_special_files
from ibe_rl.task import Task
from ibe_rl.types import Array, ConfigError, Episode

_INSTRUCTION, _GIVEN, _SUCCESS, _CONTEXT = "instruction", "instruction_given", "success", "context"
_PERCEPT = "percept"
"""Keys of the infos, of ``T + 1`` rows as in Minari; the final state has no given instruction."""
RULE = "rule"


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
    minari, folder = _minari(), find_run(str(run), Path("runs"))
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
    episodes = log.read(range(max(0, count - (newest or count)), count), percepts=True)
    env = make_env(config.env)
    about = {"algorithm_name": config.agent.kind, "author": "ibe_rl", "description": _description(task_of(env))}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the missing code link and e-mail
            buffers = [_buffer(minari, episode) for episode in episodes]
            spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
            spec = env.unwrapped.spec  # without our wrapper, which Minari could not rebuild
            return minari.create_dataset_from_buffers(
                dataset_id, buffers, env=spec, data_format="hdf5", **spaces, **about
            )
    except (ValueError, TypeError) as error:
        raise ConfigError(f"dataset={dataset_id}: {error}") from None


def _description(task: Task) -> str:
    return (
        f"{task.name} with instructions: infos[{_INSTRUCTION!r}] is the instruction, infos[{_GIVEN!r}] whether "
        f"there was one, infos[{_SUCCESS!r}] whether the episode ended well, infos[{_CONTEXT!r}] what it was about."
    )


def _buffer(minari: Any, episode: Episode) -> Any:
    steps = len(episode)
    last = np.arange(steps) == steps - 1
    silence = np.zeros_like(episode.instructions[:1])
    infos = {
        _INSTRUCTION: np.concatenate([episode.instructions, silence]),
        _GIVEN: np.append(np.asarray(episode.given, bool), False),
        _SUCCESS: np.append(False, last & episode.success),
        _CONTEXT: np.full(steps + 1, episode.context.encode()),
    }
    if episode.percepts is not None:
        infos[_PERCEPT] = episode.percepts
    return minari.data_collector.EpisodeBuffer(
        observations=episode.states,
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=last & episode.terminated,
        truncations=last & (not episode.terminated),
        infos=infos,
    )


def import_log(dataset_id: str, settings: Sequence[str] = (), instruction: str | None = None) -> Path:
    """Make a run folder of a dataset, with the vocabulary learnt from its episodes.

    Args:
        dataset_id: of a local Minari dataset.
        settings: of ``explain.py``: ``env=…`` of its states, ``run_dir=…``, ``mapping=…``.
        instruction: the key of the infos that holds it; "rule" asks the environment's own rule in each state. None
            takes ``"instruction"`` of the infos, else that in the observations, else the rule.

    Returns:
        the folder; ``explain.py run=FOLDER agent=…`` explains an agent with its vocabulary.

    Raises:
        ConfigError: if it does not fit the environment, or no vocabulary can be learnt.
    """
    minari = _minari()
    cfg = composed("explain", settings)
    try:
        dataset = minari.load_dataset(dataset_id)
    except (OSError, ValueError, ImportError) as error:
        raise ConfigError(f"dataset={dataset_id}: {' '.join(str(error).split())[:200]}") from None
    config = external_run_config(cfg, f"the agent of the dataset {dataset_id}", seed=0)
    env = make_env(config.env)
    task = task_of(env)
    check_same_actions(f"dataset={dataset_id}", dataset, env.action_space)
    _check_observations(dataset_id, dataset.observation_space, task)
    first = next(iter(dataset), None)
    if first is None:
        raise ConfigError(f"dataset={dataset_id}: it has no episode; allowed is one with episodes")
    _episode(first, task, instruction)  # check before anything is made
    folder = create_run_folder(Path(cfg.run_dir))
    keep_run(folder, config, _episodes(dataset, task, instruction), dataset.total_steps + dataset.total_episodes)
    return folder


def _check_observations(dataset_id: str, space: Any, task: Task) -> None:
    allowed = (len(task.state_names),), (_instructed_size(task),)
    if space.shape not in allowed:
        raise ConfigError(
            f"dataset={dataset_id}: its observations are of shape {space.shape}; allowed is {allowed[0]}, the state, "
            f"or {allowed[1]} with the instruction and whether it was given"
        )


def _episodes(dataset: Any, task: Task, instruction: str | None) -> Iterator[Episode]:
    return (_episode(data, task, instruction) for data in dataset)


def _episode(data: Any, task: Task, key: str | None) -> Episode:
    """Convert an episode of Minari."""
    observations, infos, steps = np.asarray(data.observations), data.infos or {}, len(data.rewards)
    states = observations[:, : len(task.state_names)].astype(np.float32)
    instructions, given = _said(observations, states, infos, task, key)
    return Episode(
        states=states,
        actions=np.asarray(data.actions),
        rewards=np.asarray(data.rewards, np.float32),
        instructions=instructions[:steps],
        given=given[:steps],
        terminated=bool(data.terminations[-1]),
        success=_succeeded(infos, task),
        context=task.context(states[0]),
        percepts=_perceived(infos, task),
    )


def _said(
    observations: Array, states: Array, infos: dict[str, Any], task: Task, key: str | None
) -> tuple[Array, Array]:
    """Instructions ``(T or more, d)`` and whether they were given."""
    if key != RULE and (key or _INSTRUCTION) in infos:
        return _heard(np.asarray(infos[key or _INSTRUCTION], np.float32), infos, task, key or _INSTRUCTION, len(states))
    if key not in (None, RULE):
        raise ConfigError(f"instruction={key}: allowed are {', '.join(infos)} of its infos, or {RULE}")
    if key is None and observations.shape[1] == _instructed_size(task):
        line = observations[:, len(task.state_names) :].astype(np.float32)
        return line[:, :-1], line[:, -1] > 0
    return task.rule(states).astype(np.float32), np.ones(len(states), bool)


def _instructed_size(task: Task) -> int:
    """Numbers of a state with an instruction and whether it was given."""
    return len(task.state_names) + task.instruction_size + 1


def _perceived(infos: dict[str, Any], task: Task) -> Array | None:
    """What the agent perceived, as exported; None where that is the state, or was not kept."""
    kept = np.asarray(infos[_PERCEPT]) if task.parts and _PERCEPT in infos else None
    return None if kept is None or kept.shape[1:] != (task.percept_size,) else kept.astype(task.percept_type)


def _heard(instructions: Array, infos: dict[str, Any], task: Task, key: str, states: int) -> tuple[Array, Array]:
    instructions = instructions.reshape(len(instructions), -1)
    if instructions.shape[1] != task.instruction_size or len(instructions) < states - 1:
        raise ConfigError(
            f"instruction={key}: it has the shape {instructions.shape} in an episode of {states - 1} steps; allowed is "
            f"{(states - 1, task.instruction_size)}, or a row more"
        )
    if not np.all(np.abs(instructions) <= 1):
        raise ConfigError(
            f"instruction={key}: its values range from {instructions.min():g} to {instructions.max():g}; "
            "allowed is -1 to 1"
        )
    return instructions, np.asarray(infos.get(_GIVEN, np.ones(len(instructions))), bool).reshape(-1)


def _succeeded(infos: dict[str, Any], task: Task) -> bool:
    """Success as of the last infos; False without an entry."""
    found = next((infos[name] for name in (_SUCCESS, task.success_key) if name in infos), [False])
    return bool(np.asarray(found).reshape(-1)[-1])


def _minari() -> Any:
    try:
        import_module("h5py")  # which its datasets are read with
        return import_module("minari")
    except ImportError as error:
        raise ConfigError(f"needs minari ({error}); install the extra ibe_rl[minari]") from None


def minari_command(arguments: Sequence[str] | None = None) -> int:
    """Export or import from the command line."""
    parser = argparse.ArgumentParser(prog=typed("minari"), description="Logs for and from Minari.")
    commands = parser.add_subparsers(dest="command", required=True)
    out = commands.add_parser("export", help="a run's log as a dataset")
    out.add_argument("run", help="folder of the run")
    out.add_argument("dataset", help="name of the dataset, as mine/log-v0")
    out.add_argument("--newest", type=int, help="number of episodes, the newest; default: all")
    into = commands.add_parser("import", help="a dataset as a run folder")
    into.add_argument("dataset", help="name of a local Minari dataset")
    into.add_argument("settings", nargs="*", help="of explain.py: env=…, run_dir=…, mapping=…")
    into.add_argument("--instruction", help=f"key of the infos, or {RULE} for the environment's own rule")
    asked = parser.parse_args(arguments)
    try:
        if asked.command == "export":
            made = export_log(asked.run, asked.dataset, asked.newest)
            line = f"{asked.dataset}: {made.total_episodes:,} episodes, {made.total_steps:,} steps"
        else:
            folder = import_log(asked.dataset, asked.settings, asked.instruction)
            line = f"{folder}: explain an agent in its words with {typed('explain')} run={folder} agent=…"
    except ConfigError as error:
        sys.exit(f"error: {error}")
    sys.stdout.write(f"{line}\n")
    return 0


if __name__ == "__main__":
    sys.exit(minari_command())
