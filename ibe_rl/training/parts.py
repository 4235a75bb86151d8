"""What the loop of train.py works with, made from the settings, and its state to go on from another time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl import timeit
from torchrl.checkpoint import GlobalRNGState

from ibe_rl.agents import Agent, check_actions, check_agent, make_agent
from ibe_rl.apps.paper.report_context import check_report
from ibe_rl.apps.teach import Classroom, NoClassroom
from ibe_rl.collect.collector import EVALUATION_SEED, check_collect
from ibe_rl.config.command_line import installed, is_sweep, own_configs, run_name
from ibe_rl.config.settings import RegressionConfig, TrainConfig
from ibe_rl.envs.make import make_game, task_of
from ibe_rl.envs.snapshots import make_copy
from ibe_rl.ibe import Reactions
from ibe_rl.instructors import check_instructor, make_instructor, stand_in
from ibe_rl.predict import KeptPredictor, check_predictor, is_learnt, make_predictor
from ibe_rl.runtime.workers import LostWorkerError
from ibe_rl.storage.checkpoint import BEST, LATEST, PREDICTOR, as_arrays, as_tensors, link, save_latest, save_policy
from ibe_rl.storage.log import TrajectoryLog, UnreadableLogError
from ibe_rl.storage.partial_episode import UnderWay
from ibe_rl.storage.run_folder import CHECKPOINTS, METRICS, RECORDING, TRAJECTORIES, MetricsTable
from ibe_rl.task import Task
from ibe_rl.training.instruction_reward import Obedience, check_obedience, make_obedience
from ibe_rl.training.progress import TrainingProgress
from ibe_rl.training.resume import PARTS, State, must_fit
from ibe_rl.types import ConfigError, Instructor
from ibe_rl.view.recorder import NoRecorder
from ibe_rl.view.run_recorder import RunRecorder
from ibe_rl.vocabulary.reactions import ASKED_AT, ask_in_flight
from ibe_rl.vocabulary.tracker import FIGURES, Development, check_development

LATER_COLUMNS = (
    "eval/return_mean",
    "eval/success_rate",
    *FIGURES,
    "ibe/skipped",
)
"""Columns of metrics.csv that only some rows fill."""
TIMES = ("setup", "collect", "learn", "log", "refresh", "explain", "stream", "eval", "checkpoint")
NOBODY = NoClassroom()
ASKING_SEED = EVALUATION_SEED + 100_000


@dataclass
class Counts:
    """What has been counted, and the times of earlier sittings of a run that was resumed."""

    refreshes: int = 0
    kept: int = 0
    skipped: int = 0
    best_success: float = -1.0
    best_return: float = -math.inf
    best_frames: int = -1
    wall_s: float = 0.0
    times_s: dict[str, float] = field(default_factory=dict)


@dataclass
class Parts:
    """What the loop works with; none of the parts knows another."""

    task: Task
    agent: Agent
    instructor: Instructor
    predictor: KeptPredictor
    log: TrajectoryLog
    recorder: RunRecorder | NoRecorder
    watched_env: gymnasium.Env[Any, Any]
    evaluation_envs: list[gymnasium.Env[Any, Any]]
    classroom: Classroom | NoClassroom
    progress: TrainingProgress
    table: MetricsTable
    folder: Path
    development: Development
    obedience: Obedience
    learns_to_predict: bool = False
    random: GlobalRNGState = field(default_factory=GlobalRNGState)
    counts: Counts = field(default_factory=Counts)
    under_way: list[UnderWay] = field(default_factory=list)

    def foresee(self) -> None:
        """Let the predictor learn from the log as it stands, keep what it has learnt, and forget all else."""
        self.predictor.learn(self.log)
        if self.learns_to_predict:
            state = as_tensors(self.predictor.state_dict())
            save_policy(self.folder / CHECKPOINTS, self.log.frames, state, PREDICTOR)
        self.predictor.forget()  # so that a resumed run predicts the same


def ask_otherwise(cfg: TrainConfig, parts: Parts, horizon_steps: int) -> Reactions | None:
    """What the greedy policy does if it is told otherwise; None where it does not listen, or nothing can foretell it.

    Moments are of episodes that are never trained on, each from another one.
    """
    if isinstance(cfg.predictor, RegressionConfig) or not len(parts.log.index):  # the former does not ask the policy
        return None
    counts = parts.counts
    first = ASKING_SEED + ASKED_AT * (counts.refreshes + counts.kept + counts.skipped)
    typical_steps, seeds = int(np.median(parts.log.index["steps"][-200:])), range(first, first + ASKED_AT)
    who = parts.evaluation_envs, parts.agent.greedy, parts.instructor, parts.predictor
    return ask_in_flight(*who, seeds, typical_steps, horizon_steps)


def check_parts(cfg: TrainConfig, task: Task, actions: gymnasium.Space[Any]) -> None:
    """Refuse settings that cannot work, before anything is made.

    Args:
        cfg: of the run.
        task: of the environment.
        actions: that it takes.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not is_sweep() and (cfg.runs_at_once or cfg.runs_on):
        raise ConfigError(f"runs_at_once={cfg.runs_at_once}, runs_on={cfg.runs_on}: allowed only in a sweep (-m)")
    check_collect(cfg.collect)
    check_agent(cfg.agent, task.state_names)
    check_actions(cfg.agent, actions)
    check_instructor(cfg.instructor, cfg.collect, task)
    check_development(cfg, task)
    check_obedience(cfg)
    check_report(cfg, task)
    check_predictor(cfg.predictor, cfg.instructor, make_game(cfg.env))
    if not is_learnt(cfg.predictor):
        make_copy(cfg.env)  # to predict in


def build(
    cfg: TrainConfig,
    folder: Path,
    owned: ExitStack,
    classroom: Classroom | NoClassroom = NOBODY,
    state: State | None = None,
) -> Parts:
    """Make the parts from their settings.

    Args:
        cfg: of the run.
        folder: of the run.
        owned: closes what has been opened.
        classroom: where a person teaches, if one does.
        state: from ``save_state``, to go on from; the random state is left to ``begin``.

    Raises:
        ConfigError: if the state does not fit the settings, or the folder.
    """
    torch.set_num_threads(1)
    torch.manual_seed(cfg.seed)
    make_one = partial(make_game, cfg.env)
    env = make_one()
    task = task_of(env)
    development = Development(cfg.mapping, task, cfg.seed, cfg.refresh_when_stale)
    recorder = _recorder(cfg, folder, task, state)
    owned.callback(recorder.close)
    until_frames = (state["frames"] or None) if state else None  # at 0 it may have ended before the first row
    making = cfg.predictor, partial(make_copy, cfg.env), task.rule, cfg.seed, env
    predictor = make_predictor(*making, lambda: development.horizons_steps)
    parts = Parts(
        task=task,
        agent=make_agent(cfg.agent, task.observation_size, env.action_space, cfg.total_frames, task.state_names),
        instructor=make_instructor(stand_in(cfg.instructor), task, cfg.seed),
        predictor=owned.enter_context(closing(predictor)),
        log=TrajectoryLog(folder / TRAJECTORIES, cfg.log.capacity_frames, task.contexts),
        recorder=recorder,
        watched_env=env,
        evaluation_envs=[make_one() for _ in range(min(cfg.eval_episodes, 100))],
        classroom=classroom,
        progress=owned.enter_context(TrainingProgress(cfg.total_frames)),
        table=owned.enter_context(MetricsTable(folder / METRICS, LATER_COLUMNS, until_frames)),
        folder=folder,
        development=development,
        obedience=make_obedience(cfg, task, development),
        learns_to_predict=is_learnt(cfg.predictor),
    )
    if state:
        _load_state(parts, state)
    return parts


def _recorder(cfg: TrainConfig, folder: Path, task: Task, state: State | None) -> RunRecorder | NoRecorder:
    if cfg.viewer.mode == "off":
        return NoRecorder()
    name, max_mb = run_name(folder), cfg.viewer.max_recording_mb
    with must_fit(folder) if state else nullcontext():
        return RunRecorder(folder / RECORDING, task, name, max_mb, state and state["recorder"])


def _load_state(parts: Parts, state: State) -> None:
    _load_log(parts, state["log"])
    with must_fit(parts.folder):
        parts.agent.load_state_dict(state["agent"])
        for name in ("development", "obedience", "predictor"):
            getattr(parts, name).load_state_dict(as_arrays(state[name]))
        parts.counts = Counts(**state["counts"])
        parts.under_way = parts.log.under_way()


def _load_log(parts: Parts, state: State) -> None:
    with must_fit(parts.folder):
        try:
            parts.log.load_state_dict(as_arrays(state))
        except UnreadableLogError as error:
            raise ConfigError(
                f"resume={parts.folder}: {error}; put the file back from a copy, or move {parts.log.folder} "
                "out of the way to go on with an empty log"
            ) from None


def whole_state(parts: Parts, wall_s: float) -> State:
    """All that the run goes on from as it stands; the log is on disk then."""
    parts.log.flush()
    counts = vars(parts.counts) | {"wall_s": wall_s, "times_s": times(parts.counts)}
    state = {name: as_tensors(getattr(parts, name).state_dict()) for name in set(PARTS) - {"agent"}}
    state["agent"] = parts.agent.state_dict()  # torch's own already; a copy would lack what it notes beside the values
    return {"frames": parts.log.frames, "counts": counts, **state}


def save_state(parts: Parts, state: State) -> None:
    """Keep a ``whole_state`` in one file that replaces the one before in one go; the best one stays too."""
    save_latest(parts.folder / CHECKPOINTS, state)
    if state["frames"] == state["counts"]["best_frames"]:
        link(parts.folder / CHECKPOINTS, LATEST, BEST)


@contextmanager
def resumable(parts: Parts, wall_s: Callable[[], float]) -> Iterator[None]:
    """If a worker is lost between two batches, keep the run as it stands and say how it goes on.

    Raises:
        LostWorkerError: again, in one line with what can be done.
    """
    try:
        yield
    except LostWorkerError as error:
        if not parts.log.frames:
            raise LostWorkerError(f"{error}; nothing had been collected yet, start the run anew") from None
        save_state(parts, whole_state(parts, wall_s()))
        command = f"{installed('python')} train.py {own_configs()}resume={parts.folder}"
        raise LostWorkerError(
            f"{error}; the run is kept as it was at {parts.log.frames:,} frames, to go on: {command}"
        ) from None


def begin(parts: Parts, state: State | None) -> None:
    """Let chance go on where it was, when all has been made, which draws too; or keep the state of the beginning."""
    if state:
        with must_fit(parts.folder):
            parts.random.load_state_dict(state["random"])
    else:
        save_state(parts, whole_state(parts, wall_s=0.0))  # from here on the run can be resumed, whenever it is killed


def times(counts: Counts) -> Mapping[str, float]:
    """Seconds spent so far, in earlier sittings too, by what they were spent on."""
    seconds = timeit.todict(percall=False)
    return {name: seconds.get(name, 0.0) + counts.times_s.get(name, 0.0) for name in TIMES}


def timed(name: str, endless: Iterator[TensorDictBase]) -> Iterator[TensorDictBase]:
    """Count the time spent waiting for each batch under ``name``."""
    while True:
        with timeit(name):
            batch = next(endless)
        yield batch
