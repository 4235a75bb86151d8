"""What all experiments share: a run, its settings, environments to fly in; and the agents A, B and C."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np
import torch
from threadpoolctl import threadpool_limits

from ibe_rl.apps.paper.agents import PAPER_SUCCESS, Fly, FlyAll, Skilled, most_flights, screen
from ibe_rl.apps.paper.words import PAPER, variants
from ibe_rl.collect.rollout import play
from ibe_rl.config.command_line import choices
from ibe_rl.config.settings import EnvConfig, ExplainConfig, FiguresConfig, InstructorConfig, MappingConfig, TrainConfig
from ibe_rl.envs.make import make_game, task_of
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.rollouts import EPISODES_AT_ONCE, SEEDS_EACH, seeds_for
from ibe_rl.evaluation.run_predictor import PROCESSES
from ibe_rl.evaluation.runs import kept_policies
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.instructors import make_instructor, speaks, stand_in
from ibe_rl.runtime.signals import interrupts_stay_here, script_stays_here
from ibe_rl.storage.checkpoint import BETWEEN, EVALUATED
from ibe_rl.task import Task
from ibe_rl.types import ConfigError, Episode, Instructor, Policy

DEFAULT_MAPPING = "axis"
"""Held against the paper's where the run itself speaks in the paper's."""


def check_task(task: Task) -> None:
    """Refuse an environment that the experiments cannot be done in.

    Raises:
        ConfigError: naming what it does not declare, or that its instructions have several numbers.
    """
    if task.instruction_size != 1:
        raise ConfigError(
            f"task=figures: an instruction of {task.name} has {task.instruction_size} numbers; allowed is one number, "
            "as in the paper (task=evaluate judges several)"
        )
    missing = [name for name in ("motion", "first_contact", "scene_path") if getattr(task, name) is None]
    if missing:
        raise ConfigError(f"task=figures: {task.name} does not declare {', '.join(missing)}; allowed is one that does")


def check_report(cfg: TrainConfig, task: Task) -> None:
    """Refuse, before the training, what its report would have to refuse after it.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not cfg.report:
        return
    check_task(task)
    if cfg.refresh_every_frames is None or not speaks(cfg.instructor):
        key = "instructor=silent" if cfg.refresh_every_frames is not None else "refresh_every_frames=null"
        raise ConfigError(f"report=true with {key}: allowed is a training that learns a vocabulary")


class Airfield:
    """Environments to fly in, made when they are first needed; it can be sent to other processes.

    Args:
        env: which environments.
        instructor: who instructs there.
    """

    def __init__(self, env: EnvConfig, instructor: InstructorConfig):
        self._env, self._instructor = env, instructor
        self._envs: list[gymnasium.Env[Any, Any]] = []

    def fly(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Fly a greedy episode for each seed."""
        while len(self._envs) < min(EPISODES_AT_ONCE, len(seeds)):
            self._envs.append(make_game(self._env))
        return play(self._envs, policy, make_instructor(self._instructor, task_of(self._envs[0])), seeds)


@contextmanager
def flying_together(airfield: Airfield, processes: int) -> Iterator[tuple[Fly, FlyAll]]:
    """What ``screen`` flies with, in this process or shared between others."""
    if processes == 1:
        yield airfield.fly, map
        return

    def fly_all(*each: Any) -> Iterator[list[Episode]]:
        with interrupts_stay_here(), script_stays_here():
            return workers.map(*each)

    spawn = multiprocessing.get_context("spawn")
    workers = ProcessPoolExecutor(processes, spawn, _keep, (airfield,))
    try:
        yield _fly, fly_all
    finally:
        workers.shutdown(cancel_futures=True)  # at Ctrl-C nobody waits for flights that have not begun


_kept: list[Airfield] = []
"""The airfield of a process that flies for another one."""


def _keep(airfield: Airfield) -> None:
    threadpool_limits(1)
    torch.set_num_threads(1)
    _kept[:] = [airfield]


def _fly(policy: Policy, seeds: Sequence[int]) -> list[Episode]:
    return _kept[0].fly(policy, seeds)


@dataclass(frozen=True)
class Lab:
    """A run and the settings of its experiments.

    Raises:
        ConfigError: if its environment does not declare what the experiments need.
    """

    run: TrainedRun
    cfg: ExplainConfig

    def __post_init__(self) -> None:
        check_task(self.run.task)

    @property
    def config(self) -> FiguresConfig:
        """The settings of the experiments."""
        return self.cfg.figures

    @property
    def task(self) -> Task:
        """The environment's own."""
        return self.run.task

    @property
    def horizon_steps(self) -> int:
        """n, the run's own."""
        return self.run.horizon_steps

    @cached_property
    def mappings(self) -> dict[str, MappingConfig]:
        """The paper's vocabulary and the run's own, and each with a half of the other."""
        known, own = choices("mapping"), self.run.config.mapping
        return variants(known["paper"], known[DEFAULT_MAPPING] if own.kind == "paper" else own)

    @cached_property
    def airfield(self) -> Airfield:
        """Where whole episodes are flown."""
        return Airfield(self.run.config.env, stand_in(self.run.config.instructor))

    @property
    def instructor(self) -> Instructor:
        """One that begins anew."""
        return make_instructor(stand_in(self.run.config.instructor), self.task)

    def seeds(self, purpose: str, count: int) -> range:
        """Of episodes that are flown for nothing else."""
        return seeds_for(purpose, self.config.seed, count)

    def fly(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Fly a greedy episode for each seed."""
        return self.airfield.fly(policy, seeds)


def find_agents(lab: Lab) -> tuple[list[Skilled], list[dict[str, Any]]]:
    """The agents, flown again on fresh seeds; and how good all policies were that they were chosen from."""
    policies: dict[int, Policy] = dict(kept_policies(lab.run, EVALUATED, BETWEEN))
    title, most = f"looking for A and B among {len(policies)} policies", most_flights(len(policies))
    processes = lab.cfg.predictor.processes or PROCESSES
    with progress_bar(title, most) as step, flying_together(lab.airfield, processes) as (fly, fly_all):
        chosen, tried = screen(policies, fly, lab.seeds("screened", SEEDS_EACH), step, fly_all)
    chosen["C"] = lab.run.policy_frame
    agents, seeds = [], lab.seeds("flown", lab.config.episodes)
    with progress_bar("A, B and C fly again", len(chosen)) as step:
        for name, frame in chosen.items():
            episodes = lab.fly(policies[frame], seeds)
            agents.append(Skilled(name, PAPER_SUCCESS.get(name), frame, policies[frame], episodes))
            step()
    rates = [(frame, len(flown), float(np.mean(flown))) for frame, flown in sorted(tried.items())]
    return agents, [{"frame": frame, "episodes": count, "success": rate} for frame, count, rate in rates]


def protocol(lab: Lab) -> dict[str, Any]:
    """What the numbers stand on."""
    config, run = lab.config, lab.run
    counts = {"screened": SEEDS_EACH, "flown": config.episodes, "checked": config.checked_episodes}
    return {
        "run": run.folder.name,
        "agent": run.config.agent.kind,
        "environment": lab.task.name,
        "actions": "greedy",
        "horizon_steps": lab.horizon_steps,
        "n_clusters": run.config.mapping.n_clusters,
        "top_fraction": lab.mappings[PAPER].top_fraction,
        "default_mapping": next(reversed(lab.mappings.values())).kind,
        "seen_steps": SEEN_STEPS,
        "futures": lab.cfg.predictor.futures,
        "band": lab.task.explained_band[0],
        "context": lab.task.context_option,
        "seed": config.seed,
        "seeds": {name: [seeds[0], seeds[-1]] for name, count in counts.items() if (seeds := lab.seeds(name, count))},
        "clusterings": config.clusterings,
        "shuffles": config.shuffles,
        "resamples": config.resamples,
    }
