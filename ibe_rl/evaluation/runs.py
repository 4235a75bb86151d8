"""Open a run folder: settings, greedy policy and vocabulary. No code from the folder runs."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium

from ibe_rl.agents import GreedyPolicy, make_agent
from ibe_rl.agents.encoder import encoded_size
from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.config.command_line import named_settings
from ibe_rl.config.limits import check
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import EnvConfig, ExplainConfig, TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.evaluation.trained_run import SPOKEN_CALIBRATION, WHAT_IF_CALIBRATION, TrainedRun
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES
from ibe_rl.ibe.interpret import Reactions
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.storage.checkpoint import BETWEEN, EVALUATED, load, policies
from ibe_rl.storage.run_folder import (
    CALIBRATION,
    CHECKPOINTS,
    CONFIG,
    EVALUATION,
    METRICS,
    REFRESHES,
    find_run,
    read_json,
    refuse_special_files,
)
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Policy
from ibe_rl.vocabulary.refresh import Saved, load_refresh
from ibe_rl.vocabulary.training_episodes import settled
from ibe_rl.vocabulary.words import take_up_words

_RUNS = Path("runs")
NO_POLICY = "policy yet; it is kept at each evaluation"
OF_A_NEW_FOLDER = {"env", "mapping", "episodes", "random_actions", "run_dir"}
"""Settings that only apply when a run folder for an external policy is made."""
MakePolicy = Callable[[TrainConfig], Policy]
"""From the config of a run to an external policy for its environment."""
BESIDE_AN_AGENT = {"agent_sees_instruction", "agent_vec_normalize", "agent_frame_stack"}
"""Settings that say how to read observations for an external policy."""


def open_trained(
    run: str | None,
    external_policy: MakePolicy | None = None,
    env: EnvConfig | None = None,
    trusted: Sequence[str] = (),
) -> TrainedRun:
    """Open the run in the folder ``run``, or the newest below ``runs/`` that can explain if None; see ``load_run``.

    Raises:
        ConfigError: if there is none; and as ``load_run``.
    """
    return load_run(find_run(run, _RUNS, _can_explain), external_policy, env, trusted)


def run_config(folder: Path, env: EnvConfig | None = None, trusted: Sequence[str] = ()) -> TrainConfig:
    """The settings that the run in ``folder`` was trained with; ``env`` and ``trusted`` as in ``load_run``.

    Raises:
        ConfigError: if the folder holds anything but plain files, or its config is damaged.
    """
    refuse_special_files(folder)
    config: TrainConfig = load_config(folder / CONFIG, TrainConfig, env, trusted)
    check(config)
    return config


def settings_named(cfg: ExplainConfig) -> set[str]:
    """The settings named on the command line, including groups for the run folder of an external policy."""
    return named_settings() | {re.split("[.=]", one)[0] for one in cfg.guest_settings}


def refuse_external_settings(cfg: ExplainConfig) -> None:
    """Refuse settings of external policies if none is named.

    Raises:
        ConfigError: naming the key.
    """
    if superfluous := sorted((OF_A_NEW_FOLDER | BESIDE_AN_AGENT) & settings_named(cfg)):
        raise ConfigError(f"{superfluous[0]}= without agent=: allowed only beside it, for an agent trained elsewhere")


def load_run(
    folder: Path,
    external_policy: MakePolicy | None = None,
    env: EnvConfig | None = None,
    trusted: Sequence[str] = (),
) -> TrainedRun:
    """Open the newest state of the run in ``folder``.

    Args:
        folder: of the run.
        external_policy: needed for a folder that was made for an external policy, which it does not hold.
        env: takes the place of the saved environment.
        trusted: kinds, as ``module:Class``, whose code may be run although no config file names it.

    Raises:
        ConfigError: if config, policy or vocabulary are missing or damaged.
    """
    config = run_config(folder, env, trusted)
    made = make_env(config.env)
    task = task_of(made)
    take_up_words(folder, task)
    if _is_external(folder, config, bool(external_policy)):
        frame, _ = _last(_refreshes(folder), folder, "vocabulary")
    else:
        frame, path = _last(policies(folder / CHECKPOINTS), folder, NO_POLICY)
    saved = _last_refresh(folder, frame)
    for steps, mapping in {**saved.spans, saved.horizon_steps: saved.mapping}.items():
        _check_vocabulary(folder, steps, mapping, task)
    judged = _judged_calibrations(folder, saved)
    calibration = judged.get(SPOKEN_CALIBRATION, judged.get("calibration", saved.calibration))
    of_answers = judged.get(WHAT_IF_CALIBRATION)
    for found in (calibration, of_answers):
        if found is not None and found.names != CONFIDENCE_FEATURES:
            known = ", ".join(CONFIDENCE_FEATURES)
            raise ConfigError(f"{folder}: its confidence is made of {', '.join(found.names)}; allowed are {known}")
    return TrainedRun(
        folder=folder,
        config=replace(config, mapping=settled(config.mapping, saved.horizon_steps)),
        task=task,
        policy=external_policy(config) if external_policy else _load_policy(path, config, made),
        policy_frame=frame,
        mapping=saved.mapping,
        mapping_frame=saved.frame,
        horizon_steps=saved.horizon_steps,
        spans=saved.spans,
        calibration=calibration,
        reactions=_reactions(folder, saved, task),
        scores_of_numbers=saved.scores_of_numbers,
        what_if_calibration=of_answers,
    )


def _can_explain(folder: Path) -> bool:
    """Whether a run has got so far that it has a vocabulary and, if it was a training, a policy."""
    has_policy = not (folder / METRICS).exists() or bool(policies(folder / CHECKPOINTS))
    return has_policy and bool(_refreshes(folder))


def _is_external(folder: Path, config: TrainConfig, named: bool) -> bool:
    """Whether the folder was made for an external policy, which then has to be ``named``."""
    if isinstance(config.agent, ExternalPolicyConfig) and not named:
        raise ConfigError(
            f"agent=null with run={folder}: its agent is not in it, it was trained elsewhere "
            f"({config.agent.made_from}); allowed is its file or module:name, which you trust"
        )
    if named and not isinstance(config.agent, ExternalPolicyConfig):
        raise ConfigError(
            f"agent= with run={folder}: that run has an agent of its own; allowed is one made for an external policy"
        )
    return named


def _check_vocabulary(folder: Path, horizon_steps: int, mapping: ClusterMapping, task: Task) -> None:
    dimensions, numbers = len(mapping.space.mean), mapping.expressions.shape[1]
    if dimensions != len(task.state_names):
        raise ConfigError(f"{folder}: its vocabulary is for {dimensions} state dimensions, not {len(task.state_names)}")
    if numbers != task.instruction_size:
        raise ConfigError(f"{folder}: its vocabulary is for {numbers} numbers in an instruction")
    if not 1 <= horizon_steps <= task.max_episode_steps:
        most = task.max_episode_steps
        raise ConfigError(f"{folder}: its vocabulary is for {horizon_steps} steps; allowed are 1 to {most}")


def _reactions(folder: Path, saved: Saved, task: Task) -> Reactions | None:
    numbers, dimensions = task.instruction_size, len(task.state_names)
    if saved.reactions is not None and saved.reactions.up.shape[1:] != (numbers, dimensions):
        found = saved.reactions.up.shape
        raise ConfigError(f"{folder}: its agent's reactions have the shape {found}, not (.., {numbers}, {dimensions})")
    return saved.reactions


def _judged_calibrations(folder: Path, saved: Saved) -> dict[str, Calibration]:
    """The calibrations of ``task=evaluate``, from many more episodes, if they are of this vocabulary."""
    path = folder / EVALUATION / CALIBRATION
    if not path.exists():
        return {}
    try:
        saved_json = read_json(path)
        mine = (saved_json["mapping_frame"], saved_json["horizon_steps"]) == (saved.frame, saved.horizon_steps)
        further = {WHAT_IF_CALIBRATION, SPOKEN_CALIBRATION} & {*saved_json}  # missing in files of earlier versions
        return {name: Calibration.from_dict(saved_json[name]) for name in ("calibration", *further) if mine}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: not a readable calibration ({error})") from None


def kept_policies(run: TrainedRun, *kinds: str) -> dict[int, GreedyPolicy]:
    """Training frames to the greedy policy saved then, oldest first; see ``checkpoint.policies``.

    Raises:
        ConfigError: if one of them is damaged.
    """
    env = run.make_env()
    found = policies(run.folder / CHECKPOINTS, *kinds)
    return {frame: _load_policy(path, run.config, env) for frame, path in found.items()}


def earlier_state(run: TrainedRun, near_frame: int) -> TrainedRun:
    """The run as it was at a training frame.

    Args:
        run: opened.
        near_frame: of the kept policies the one nearest to it is taken, with the vocabulary of that time.

    Raises:
        ConfigError: if it kept none, or had no vocabulary yet.
    """
    kept = policies(run.folder / CHECKPOINTS, EVALUATED, BETWEEN)
    _last(kept, run.folder, NO_POLICY)
    frame = min(kept, key=lambda at: abs(at - near_frame))
    saved = _last_refresh(run.folder, frame)
    return replace(
        run,
        config=replace(run.config, mapping=settled(run.config.mapping, saved.horizon_steps)),
        policy=_load_policy(kept[frame], run.config, run.make_env()),
        policy_frame=frame,
        mapping=saved.mapping,
        mapping_frame=saved.frame,
        horizon_steps=saved.horizon_steps,
        spans=saved.spans,
        calibration=saved.calibration,
        reactions=_reactions(run.folder, saved, run.task),
        scores_of_numbers=saved.scores_of_numbers,
        what_if_calibration=None,
    )


def kept_refreshes(run: TrainedRun) -> dict[int, Saved]:
    """Training frames to the vocabularies learnt then, oldest first.

    Raises:
        ConfigError: if one of them is damaged.
    """
    return {frame: _read_refresh(path) for frame, path in _refreshes(run.folder).items()}


def _load_policy(path: Path, config: TrainConfig, env: gymnasium.Env[Any, Any]) -> GreedyPolicy:
    task = task_of(env)
    widths = [encoded_size(task.observation_size, task.parts), *config.agent.hidden]
    state = load(path)
    if min(widths) < 1 or sum(math.prod(pair) for pair in pairwise(widths)) > path.stat().st_size:
        raise ConfigError(
            f"{path}: not a policy of this run (agent.hidden={config.agent.hidden}, which it has no weights for)"
        )
    agent = make_agent(
        config.agent, task.observation_size, env.action_space, config.total_frames, task.state_names, task.parts
    )
    try:
        agent.greedy.load_state_dict(state)
    except (RuntimeError, AttributeError, TypeError) as error:
        raise ConfigError(f"{path}: not a policy of this run ({' '.join(str(error).split())[:200]})") from None
    return agent.greedy


def _refreshes(folder: Path) -> dict[int, Path]:
    found = {int(path.stem): path for path in (folder / REFRESHES).glob("*.json") if path.stem.isdecimal()}
    return dict(sorted(found.items()))


def _read_refresh(path: Path) -> Saved:
    try:
        return load_refresh(path)
    except ValueError as error:
        raise ConfigError(str(error)) from None


def _last_refresh(folder: Path, frame: int) -> Saved:
    """The newest refresh up to the policy's frame."""
    usable = {learnt: path for learnt, path in _refreshes(folder).items() if learnt <= frame}
    _, path = _last(usable, folder, f"vocabulary from before its policy of frame {frame:,}")
    return _read_refresh(path)


def _last(found: dict[int, Path], folder: Path, what: str) -> tuple[int, Path]:
    if not found:
        raise ConfigError(f"run={folder}: it has no {what}")
    return list(found.items())[-1]
