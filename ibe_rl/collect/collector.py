"""TorchRL's collector over batched environments, in one or several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableSequence, Sequence
from copy import deepcopy
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, Self

import gymnasium
import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl import timeit
from torchrl.collectors import BaseCollector, Collector
from torchrl.envs import EnvBase

from ibe_rl.agents import Agent
from ibe_rl.collect.worker_envs import WorkerEnvs, raise_child_error
from ibe_rl.config.settings import CollectConfig, EnvConfig, InstructorConfig
from ibe_rl.envs.errors import GateError
from ibe_rl.envs.instructed_envs import InstructedEnvs, make_vector_env
from ibe_rl.envs.make import make_env
from ibe_rl.envs.trial import play_briefly
from ibe_rl.instructors import make_instructor
from ibe_rl.runtime.apps import load_app
from ibe_rl.runtime.child_errors import ChildErrors
from ibe_rl.runtime.signals import interrupts_stay_here, script_stays_here
from ibe_rl.runtime.workers import (
    LostWorkerError,
    Processes,
    Workers,
    end_with_parent,
    next_of,
    start_method_for_torchrl,
    starting,
)
from ibe_rl.storage.log_columns import TOLD_COLUMN
from ibe_rl.storage.partial_episode import PartialEpisode
from ibe_rl.task import Task
from ibe_rl.types import Array, Instructor

SEEDS_PER_RUN = 100_000
"""A run's environments are seeded from ``seed * SEEDS_PER_RUN`` upwards; their episodes by ``episode_seed``."""
OUTLIVES_TRAINER_S = 15.0
"""Seconds that a lesson outlives its trainer, to report the loss."""
OpenLesson = Callable[[MutableSequence[gymnasium.Env[Any, Any]]], Instructor]
"""Opens the first environment to a human; returns its instructor."""


def env_of_worker(
    worker: int,
    env: EnvConfig,
    collect: CollectConfig,
    task: Task,
    instructor: InstructorConfig,
    seed: int,
    lesson: OpenLesson | None = None,
    partial_episodes: Sequence[PartialEpisode] = (),
    child_errors: Path | None = None,
) -> EnvBase:
    """Make a worker's environments in its own process; ``partial_episodes`` are those of all workers."""
    torch.set_num_threads(1)
    if apart(collect):
        end_with_parent(OUTLIVES_TRAINER_S if lesson else 0.0)
        play_briefly(make_env(env), seed=0)  # its errors appear before the training
    first = seed * SEEDS_PER_RUN + worker * collect.envs_per_process
    envs = [make_env(env) for _ in range(collect.envs_per_process)]
    person = lesson(envs) if lesson else None
    mine = partial_episodes[worker * collect.envs_per_process :][: collect.envs_per_process]
    kind = partial(WorkerEnvs, child_errors=child_errors) if child_errors else InstructedEnvs
    made = make_vector_env(envs, make_instructor(instructor, task, first, person), first, mine, kind)
    torch.manual_seed(_exploration_seed(first, mine))  # last: construction draws numbers
    return made


def _exploration_seed(first: int, partial_episodes: Sequence[PartialEpisode]) -> int:
    """Seed of the exploration; a resumed run does not repeat the draws of its beginning."""
    begun = [first, *(one.ended for one in partial_episodes), *(len(one.actions) for one in partial_episodes)]
    return int(np.random.SeedSequence(begun).generate_state(1)[0]) if partial_episodes else first


def apart(collect: CollectConfig) -> bool:
    """True if processes other than the trainer collect."""
    return collect.processes > 1 or collect.overlap or collect.engine == "ray"


def make_collector(
    agent: Agent,
    env: EnvConfig,
    collect: CollectConfig,
    task: Task,
    instructor: InstructorConfig,
    seed: int,
    lesson: OpenLesson | None = None,
    partial_episodes: Sequence[PartialEpisode] = (),
) -> BaseCollector:
    """Make the collector; each of its processes has its own instructor.

    Args:
        agent: its ``policy`` collects.
        env: made once per row.
        collect: how many of them, in how many processes.
        task: of the environment.
        instructor: see ``make_instructor``.
        seed: of the run.
        lesson: requires a single process.
        partial_episodes: the episodes that the rows resume.

    Raises:
        LostWorkerError: if a process dies or hangs before it is ready.
    """
    rows = collect.processes * collect.envs_per_process
    child_errors = ChildErrors() if apart(collect) and collect.engine != "ray" else None  # Ray sends its own
    make = partial(
        env_of_worker,
        env=env,
        collect=collect,
        task=task,
        instructor=instructor,
        seed=seed,
        lesson=lesson,
        partial_episodes=partial_episodes,
        child_errors=child_errors.folder if child_errors else None,
    )
    factories = [partial(make, worker) for worker in range(collect.processes)]
    many: dict[str, Any] = {"num_collectors": collect.processes, "sync": True, "cat_results": "stack"}
    if collect.engine == "ray":
        with interrupts_stay_here():
            ray = load_app("collect.engine=ray")
            return ray.RayWorkers(factories, deepcopy(agent.policy), rows * collect.steps_per_batch, collect)
    limit_s = collect.timeout_s if apart(collect) else None
    with interrupts_stay_here(), script_stays_here(), start_method_for_torchrl(), starting(limit_s):
        collector = Collector(
            factories if apart(collect) else factories[0],
            deepcopy(agent.policy),  # shared by the processes and updated only between batches
            frames_per_batch=rows * collect.steps_per_batch,
            total_frames=-1,
            auto_register_policy_transforms=False,  # they are for recurrent policies
            **(many if apart(collect) else {}),
        )
    collector.child_errors = child_errors
    return collector


def workers_of(collector: BaseCollector) -> Workers:
    """The worker pool of a collector."""
    if hasattr(collector, "workers"):
        workers: Workers = collector.workers
        return workers
    return Processes(getattr(collector, "procs", ()), getattr(collector, "pipes", ()))


class Batches:
    """Endless batches ``[N, T]``; close it before the collector.

    Args:
        collector: from ``make_collector``.
        agent: the learner; its weights are synchronised between collections.
        overlap: collect while the caller learns. Actions then always come from the weights of ``ahead_batches``
            updates before, so the same seed gives the same batches.
        ahead_batches: most batches collected ahead of learning.
        timeout_s: seconds without a batch before a worker counts as hung; None disables it.
    """

    def __init__(
        self,
        collector: BaseCollector,
        agent: Agent,
        overlap: bool,
        ahead_batches: int = 1,
        timeout_s: float | None = None,
    ):
        self._collector, self._agent, self._overlap = collector, agent, overlap
        self._workers = workers_of(collector)
        self._apart = bool(self._workers.names)
        self._timeout_s = timeout_s if self._apart else None
        self._asked: SimpleQueue[TensorDictBase | None] = SimpleQueue()
        self._coming: SimpleQueue[TensorDictBase | Exception] = SimpleQueue()
        self._ahead, self._most_ahead = 0, ahead_batches if overlap else 1
        args = (collector, self._asked, self._coming)
        self._thread = Thread(target=_collect, args=args, daemon=self._apart)  # a hung worker keeps no program alive

    def collect_next(self) -> None:
        """Let the workers, if there are any, collect the next batch with the current weights, and do not wait."""
        if self._apart and not self._ahead:
            self._ask()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> TensorDictBase:
        """The next batch.

        Raises:
            LostWorkerError: if a worker dies or hangs.
        """
        while self._ahead < self._most_ahead:
            self._ask()
        try:
            batch = next_of(self._coming, self._workers, self._timeout_s)
        except LostWorkerError:
            raise_child_error(self._collector)
            raise
        self._ahead -= 1
        if self._overlap:
            self._ask()
        return batch.reshape(-1, batch.shape[-1])

    def close(self) -> None:
        """Collect nothing more."""
        while not self._asked.empty():
            self._asked.get_nowait()
        self._asked.put(None)

    def _ask(self) -> None:
        if self._thread.ident is None:
            self._thread.start()
        self._agent.sync_weights()
        self._asked.put(TensorDict.from_module(self._agent.policy).data.clone())
        self._ahead += 1


def _collect(
    collector: BaseCollector,
    asked: SimpleQueue[TensorDictBase | None],
    coming: SimpleQueue[TensorDictBase | Exception],
) -> None:
    """Collect a batch with each set of weights; runs in a thread."""
    source = iter(collector)
    try:
        while (weights := asked.get()) is not None:
            collector.update_policy_weights_(weights)
            coming.put(next(source))
    except Exception as error:
        cause = getattr(error, "cause", None)  # of Ray's error for one in a worker
        coming.put(cause if isinstance(cause, GateError) else error)


def steps_of(batch: TensorDictBase) -> dict[str, Array]:
    """Arrays ``(N, T, ...)`` of a batch ``[N, T]`` for the log."""
    after = batch["next"]
    columns = {
        "state": batch["state"],
        "action": batch["action"],
        "reward": after["reward"].squeeze(-1),
        "instruction": batch["instruction"],
        "given": batch["instruction_given"].squeeze(-1).bool(),
        "next_state": after["state"],
        "done": after["done"].squeeze(-1),
        "terminated": after["terminated"].squeeze(-1),
        "success": after["success"].squeeze(-1),
    }
    if "percept" in batch.keys():  # noqa: SIM118 - a TensorDict
        columns |= {"percept": batch["percept"], "next_percept": after["percept"]}
    if TOLD_COLUMN in batch.keys():  # noqa: SIM118 - a TensorDict
        columns[TOLD_COLUMN] = batch[TOLD_COLUMN]
    return {name: column.numpy() for name, column in columns.items()}


def timed(name: str, endless: Iterator[TensorDictBase]) -> Iterator[TensorDictBase]:
    """Count the time spent waiting for each batch under ``name``."""
    while True:
        with timeit(name):
            batch = next(endless)
        yield batch
