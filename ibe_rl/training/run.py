"""The parts of a training run, and its state to resume from."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
from tensordict import TensorDictBase
from torchrl import timeit
from torchrl.checkpoint import GlobalRNGState

from ibe_rl.agents import Agent
from ibe_rl.collect.schedule import RefreshSchedule, Schedule
from ibe_rl.config.settings import TrainConfig
from ibe_rl.predict import KeptPredictor
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.storage.checkpoint import as_arrays, as_tensors
from ibe_rl.storage.log import TrajectoryLog, UnreadableLogError
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.task import Task
from ibe_rl.training.instruction_reward import InstructionReward
from ibe_rl.training.state import PARTS, State, must_fit
from ibe_rl.types import ConfigError, Instructor
from ibe_rl.vocabulary.listener import Listener, Metric
from ibe_rl.vocabulary.tracker import VocabularyTracker

TIMES = ("setup", "collect", "learn", "log", "refresh", "explain", "stream", "eval", "checkpoint")


@dataclass
class Counts:
    """Counters, and the times spent before the run was resumed."""

    refreshes: int = 0
    kept: int = 0
    skipped: int = 0
    best_success: float = -1.0
    best_return: float = -math.inf
    best_frames: int = -1
    wall_s: float = 0.0
    times_s: dict[str, float] = field(default_factory=dict)

    @property
    def tried(self) -> int:
        """Vocabularies learnt so far, taken or not."""
        return self.refreshes + self.kept

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """Remember the best evaluation."""
        if (success_rate, return_mean) > (self.best_success, self.best_return):
            self.best_success, self.best_return, self.best_frames = success_rate, return_mean, frames


@dataclass
class Run:
    """The parts of a training run; they do not know each other.

    Attributes:
        cfg: the checked settings.
        folder: of the run.
        stop: true once the run should end early.
        reward: extra reward for following instructions.
        vocabulary: relearns the vocabulary at each refresh.
        instructor: instructs evaluation episodes.
        env: the environment whose episodes are recorded.
        evaluation_envs: others of the same kind.
        recorder: writes the recording; None without one.
        metrics: the user's own; each adds columns to metrics.csv at a refresh.
        say: prints a line to the terminal.
        tell: all listeners.
        batches: endless batches ``[N, T]``.
        collect_next: lets the workers, if there are any, collect the next batch while this process goes on.
        partial_episodes: the unfinished episodes of a resumed run.
        last: whether the batch just logged is the last one.
        notes: what the trial and the first episodes found, already printed; kept in summary.json.
    """

    cfg: TrainConfig
    folder: Path
    stop: StopRequest
    task: Task
    agent: Agent
    reward: InstructionReward
    log: TrajectoryLog
    vocabulary: VocabularyTracker
    predictor: KeptPredictor
    instructor: Instructor
    env: gymnasium.Env[Any, Any]
    evaluation_envs: list[gymnasium.Env[Any, Any]]
    recorder: Any = None
    metrics: list[Metric] = field(default_factory=list)
    say: Callable[[str], None] = print
    tell: Listener = field(default_factory=Listener)
    batches: Iterator[TensorDictBase] = field(default_factory=lambda: iter(()))
    collect_next: Callable[[], None] = field(default=lambda: None)
    random: GlobalRNGState = field(default_factory=GlobalRNGState)
    counts: Counts = field(default_factory=Counts)
    partial_episodes: list[PartialEpisode] = field(default_factory=list)
    started_s: float = field(default_factory=time.perf_counter)
    resumed: bool = False
    last: bool = False
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.schedule()

    def schedule(self) -> None:
        """Start the schedules at the frames logged so far."""
        now = self.log.frames
        self._refresh_due = RefreshSchedule(self.cfg, now, begun=self.counts.tried + self.counts.skipped > 0)
        self.evaluation_due = Schedule(self.cfg.eval_every_frames, now)

    def refresh_due(self, frames: int, last: bool) -> bool:
        """Whether the vocabulary is to be relearnt now; to be asked once a batch."""
        return self._refresh_due(frames, self.log.episodes_ended, last)

    @property
    def wall_s(self) -> float:
        """Seconds of training, including those before a resume."""
        return time.perf_counter() - self.started_s + self.counts.wall_s

    def ends(self) -> bool:
        """Whether the batch just logged is the last one."""
        end = min(self.cfg.total_frames, self.cfg.stop_after_frames or self.cfg.total_frames)
        self.last = bool(self.stop) or self.log.frames >= end
        if self.stop:
            self.say("stopping in order, with a last refresh and evaluation; Ctrl-C again ends at once")
        return self.last

    def times_s(self) -> dict[str, float]:
        """Seconds spent so far, by activity."""
        seconds = timeit.todict(percall=False)
        return {name: seconds.get(name, 0.0) + self.counts.times_s.get(name, 0.0) for name in TIMES}

    def time_row(self) -> dict[str, float]:
        """``times_s`` as columns of metrics.csv."""
        return {f"time/{name}": seconds for name, seconds in self.times_s().items()}

    def state_dict(self) -> State:
        """The current state to resume from; flushes the log to disk."""
        self.log.flush()
        counts = vars(self.counts) | {"wall_s": self.wall_s, "times_s": self.times_s()}
        parts: Mapping[str, Any] = {
            "log": self.log,
            "development": self.vocabulary,
            "obedience": self.reward,
            "predictor": self.predictor,
            "random": self.random,
        }
        state = {name: as_tensors(part.state_dict()) for name, part in parts.items()}
        state["recorder"] = as_tensors(self.recorder.state_dict()) if self.recorder else {}
        state["agent"] = self.agent.state_dict()  # torch's own: a copy would lose its metadata
        assert state.keys() == set(PARTS)
        return {"frames": self.log.frames, "counts": counts, **state}

    def load_state_dict(self, state: State) -> None:
        """The inverse of ``state_dict``, except for the RNG state and the recording.

        Raises:
            ConfigError: if the state does not fit the settings, or the log is damaged.
        """
        with must_fit(self.folder):
            self._load_log(as_arrays(state["log"]))
            self.agent.load_state_dict(state["agent"])
            self.vocabulary.load_state_dict(as_arrays(state["development"]))
            self.reward.load_state_dict(as_arrays(state["obedience"]))
            self.predictor.load_state_dict(as_arrays(state["predictor"]))
            self.counts = Counts(**state["counts"])
            self.partial_episodes = self.log.partial_episodes()
        self.resumed = True
        self.schedule()

    def _load_log(self, state: Any) -> None:
        try:
            self.log.load_state_dict(state)
        except UnreadableLogError as error:
            raise ConfigError(
                f"resume={self.folder}: {error}; put the file back from a copy, or move {self.log.folder} "
                "out of the way to go on with an empty log"
            ) from None
