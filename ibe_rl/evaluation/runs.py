"""Open a run folder: its settings, its greedy policy, its vocabulary. No code from the folder runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium

from ibe_rl.agents import GreedyPolicy, make_agent
from ibe_rl.config.command_line import load_config
from ibe_rl.config.limits import check
from ibe_rl.config.settings import GuestConfig, TrainConfig
from ibe_rl.envs.make import make_game, task_of
from ibe_rl.explain.explainer import CONFIDENCE_FEATURES, ExplainerState
from ibe_rl.ibe import ClusterMapping, Reactions
from ibe_rl.metrics import Calibration
from ibe_rl.storage.checkpoint import load, policies
from ibe_rl.storage.run_folder import (
    CALIBRATION,
    CHECKPOINTS,
    CONFIG,
    EVALUATION,
    REFRESHES,
    read_json,
    refuse_special_files,
)
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Policy
from ibe_rl.vocabulary.refresh import Saved, Spans, load_refresh
from ibe_rl.vocabulary.training_episodes import settled


@dataclass(frozen=True)
class TrainedRun:
    """What a run left behind.

    Attributes:
        folder: where it lies.
        config: what it was trained with; a horizon that was found is in it.
        task: the environment's own.
        policy: the greedy policy of the last evaluation; of a guest the one that was named.
        policy_frame: training frames when it was kept.
        mapping: the vocabulary of the last refresh before that.
        mapping_frame: training frames when it was learnt.
        horizon_steps: n, the one the vocabulary was learnt with.
        spans: the vocabularies of other spans of time, by their horizon in steps.
        calibration: of the confidence, as ``task=evaluate`` found it for this vocabulary, else from the episodes
            watched before the last refresh; None if it was the first.
        reactions: what the agent did at that refresh if it was told otherwise; None if nobody had asked it.
        scores_of_numbers: see ``metrics.number_scores``, of the refresh; empty if it has none.
    """

    folder: Path
    config: TrainConfig
    task: Task
    policy: Policy
    policy_frame: int
    mapping: ClusterMapping
    mapping_frame: int
    horizon_steps: int
    spans: Spans
    calibration: Calibration | None
    reactions: Reactions | None = None
    scores_of_numbers: Sequence[Mapping[str, float]] = ()

    @property
    def voice(self) -> ExplainerState:
        """What the agent speaks with."""
        return ExplainerState(
            self.mapping, self.horizon_steps, self.task.phrases, self.spans, calibration=self.calibration
        )

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """One more environment as the run had them."""
        return make_game(self.config.env)


def load_run(folder: Path, guest: Callable[[TrainConfig], Policy] | None = None) -> TrainedRun:
    """Open the run in ``folder`` as it last was.

    Args:
        folder: of the run.
        guest: makes the policy of an agent that was trained elsewhere, for a folder that was made for such a one.

    Raises:
        ConfigError: if the folder lacks a config, a policy or a vocabulary, or one of them is damaged.
    """
    refuse_special_files(folder)
    config: TrainConfig = load_config(folder / CONFIG, TrainConfig)
    check(config)
    env = make_game(config.env)
    task = task_of(env)
    if _is_for_guests(folder, config, bool(guest)):
        frame, _ = _last(_refreshes(folder), folder, "vocabulary")
    else:
        frame, path = _last(policies(folder / CHECKPOINTS), folder, "policy yet; it is kept at each evaluation")
    saved = _last_refresh(folder, frame)
    for steps, mapping in {**saved.spans, saved.horizon_steps: saved.mapping}.items():
        _check_vocabulary(folder, steps, mapping, task)
    calibration = _judged_calibration(folder, saved) or saved.calibration
    if calibration is not None and calibration.names != CONFIDENCE_FEATURES:
        known = ", ".join(CONFIDENCE_FEATURES)
        raise ConfigError(f"{folder}: its confidence is made of {', '.join(calibration.names)}; allowed are {known}")
    return TrainedRun(
        folder,
        replace(config, mapping=settled(config.mapping, saved.horizon_steps)),
        task,
        guest(config) if guest else _load_policy(path, config, env),
        frame,
        saved.mapping,
        saved.frame,
        saved.horizon_steps,
        saved.spans,
        calibration,
        _reactions(folder, saved, task),
        saved.scores_of_numbers,
    )


def _is_for_guests(folder: Path, config: TrainConfig, named: bool) -> bool:
    """Whether the folder was made for an agent that it does not hold, which has to be ``named`` then."""
    guests = isinstance(config.agent, GuestConfig)
    if isinstance(config.agent, GuestConfig) and not named:
        raise ConfigError(
            f"agent=null with run={folder}: its agent is not in it, it was trained elsewhere "
            f"({config.agent.made_from}); allowed is its file or module:name, which you trust"
        )
    if named and not guests:
        raise ConfigError(
            f"agent= with run={folder}: that run has an agent of its own; allowed is a run that was made for a guest"
        )
    return guests


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


def _judged_calibration(folder: Path, saved: Saved) -> Calibration | None:
    """That of ``task=evaluate``, from many more episodes, if it is of this vocabulary."""
    path = folder / EVALUATION / CALIBRATION
    if not path.exists():
        return None
    try:
        told = read_json(path)
        mine = (told["mapping_frame"], told["horizon_steps"]) == (saved.frame, saved.horizon_steps)
        return Calibration.from_dict(told["calibration"]) if mine else None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: not a readable calibration ({error})") from None


def kept_policies(run: TrainedRun, *kinds: str) -> dict[int, GreedyPolicy]:
    """Training frames to the greedy policy that was kept then, oldest first; see ``checkpoint.policies``.

    Raises:
        ConfigError: if one of them is damaged.
    """
    env = run.make_env()
    found = policies(run.folder / CHECKPOINTS, *kinds)
    return {frame: _load_policy(path, run.config, env) for frame, path in found.items()}


def kept_refreshes(run: TrainedRun) -> dict[int, Saved]:
    """Training frames to the vocabularies that were learnt then, oldest first.

    Raises:
        ConfigError: if one of them is damaged.
    """
    return {frame: _read_refresh(path) for frame, path in _refreshes(run.folder).items()}


def _load_policy(path: Path, config: TrainConfig, env: gymnasium.Env[Any, Any]) -> GreedyPolicy:
    task = task_of(env)
    widths = [task.observation_size, *config.agent.hidden]
    state = load(path)
    if min(widths) < 1 or sum(math.prod(pair) for pair in pairwise(widths)) > path.stat().st_size:
        raise ConfigError(
            f"{path}: not a policy of this run (agent.hidden={config.agent.hidden}, which it has no weights for)"
        )
    agent = make_agent(config.agent, task.observation_size, env.action_space, config.total_frames, task.state_names)
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
    """The newest refresh that is no newer than the policy."""
    usable = {learnt: path for learnt, path in _refreshes(folder).items() if learnt <= frame}
    _, path = _last(usable, folder, f"vocabulary from before its policy of frame {frame:,}")
    return _read_refresh(path)


def _last(found: dict[int, Path], folder: Path, what: str) -> tuple[int, Path]:
    if not found:
        raise ConfigError(f"run={folder}: it has no {what}")
    return list(found.items())[-1]
