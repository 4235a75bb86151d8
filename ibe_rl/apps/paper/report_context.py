"""What all experiments share: a run, its settings, environments to fly in; and the agents A, B and C."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import gymnasium
import numpy as np
import torch

from ibe_rl.apps.paper.agents import PAPER_SUCCESS, PaperAgent, RunAll, most_runs, screen
from ibe_rl.apps.paper.names import PAPERS
from ibe_rl.apps.paper.vocabularies import variants
from ibe_rl.collect.rollout import play
from ibe_rl.config.hydra_setup import choice
from ibe_rl.config.report_settings import FiguresConfig
from ibe_rl.config.settings import EnvConfig, ExplainConfig, InstructorConfig, MappingConfig, TrainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.envs.wrappers import task_of
from ibe_rl.evaluation.moments import SEEN_STEPS
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.rollouts import EPISODES_AT_ONCE, SEEDS_EACH, seeds_for
from ibe_rl.evaluation.run_predictor import PROCESSES
from ibe_rl.evaluation.runs import kept_policies
from ibe_rl.evaluation.trained_run import TrainedRun, instructed_by
from ibe_rl.ibe import IBEConfig
from ibe_rl.instructors import make_instructor, speaks, stand_in
from ibe_rl.runtime.pool import ProcessPool
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
    if task.words is not None:
        raise ConfigError(
            f"task=figures: the instructions of {task.name} are words; allowed is one number, as in the paper "
            "(task=evaluate judges words)"
        )
    if task.instruction_size != 1:
        raise ConfigError(
            f"task=figures: an instruction of {task.name} has {task.instruction_size} numbers; allowed is one number, "
            "as in the paper (task=evaluate judges several)"
        )
    missing = [name for name in ("motion", "first_contact", "scene_path") if getattr(task, name) is None]
    if missing:
        raise ConfigError(f"task=figures: {task.name} does not declare {', '.join(missing)}; allowed is one that does")


def hidden_goal_env(env: EnvConfig, task: Task) -> EnvConfig:
    """The environment in which the goal cannot be seen.

    Raises:
        ConfigError: if a program has given it, and it does not take the arguments that hide the goal.
    """
    hidden = copy(env)
    hidden.kwargs = {**env.kwargs, **task.hidden_goal}
    if task.hidden_goal and env.given:
        try:
            make_env(hidden).close()
        except ConfigError as error:
            arguments = ", ".join(f"{name}={value}" for name, value in task.hidden_goal.items())
            raise ConfigError(
                f"task=figures: {error}; allowed is a function that takes {arguments}, with which the goal is hidden"
            ) from None
    return hidden


def as_ibe(config: MappingConfig) -> IBEConfig:
    """The settings of a mapping that can be compared with the paper's, one by one.

    Raises:
        ConfigError: naming the mapping and what is allowed.
    """
    if not isinstance(config, IBEConfig):
        raise ConfigError(
            f"task=figures with mapping.kind={config.kind}: it has no normalisation and membership to compare; "
            "allowed is one whose settings derive from ibe_rl.ibe.IBEConfig (task=evaluate takes any)"
        )
    return config


def check_report(cfg: TrainConfig, task: Task) -> None:
    """Refuse, before the training, what its report would have to refuse after it.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not cfg.report:
        return
    check_task(task)
    hidden_goal_env(cfg.env, task)
    as_ibe(cfg.mapping)
    if cfg.refresh_every_frames is None or not speaks(cfg.instructor):
        key = "instructor=silent" if cfg.refresh_every_frames is not None else "refresh_every_frames=null"
        raise ConfigError(f"report=true with {key}: allowed is a training that learns a vocabulary")


class EpisodeRunner:
    """Runs greedy episodes in environments that are made when first needed; it can be sent to other processes.

    Args:
        env: which environments.
        instructor: who instructs there.
    """

    def __init__(self, env: EnvConfig, instructor: InstructorConfig) -> None:
        self._env, self._instructor = env, instructor
        self._envs: list[gymnasium.Env[Any, Any]] = []

    def run(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Run an episode for each seed."""
        torch.set_num_threads(1)
        while len(self._envs) < min(EPISODES_AT_ONCE, len(seeds)):
            self._envs.append(make_env(self._env))
        return play(self._envs, policy, make_instructor(self._instructor, task_of(self._envs[0])), seeds)


@contextmanager
def shared_between(runner: EpisodeRunner, processes: int) -> Iterator[RunAll]:
    """What ``screen`` runs episodes with, in this process or shared between others."""
    if processes == 1:
        yield partial(map, runner.run)
        return
    with closing(ProcessPool(runner, processes)) as pool:
        yield lambda policies, seeds: pool.map("run", zip(policies, seeds, strict=True))


@dataclass(frozen=True)
class ReportContext:
    """A run and the settings of its experiments.

    Raises:
        ConfigError: if its environment does not declare what the experiments need, or its mapping lacks it.
    """

    run: TrainedRun
    cfg: ExplainConfig

    def __post_init__(self) -> None:
        check_task(self.run.task)
        hidden_goal_env(self.run.config.env, self.run.task)
        as_ibe(self.run.config.mapping)

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
        own = as_ibe(self.run.config.mapping)
        return variants(choice("mapping", "paper"), choice("mapping", DEFAULT_MAPPING) if own.kind == "paper" else own)

    @cached_property
    def runner(self) -> EpisodeRunner:
        """Runs whole episodes."""
        return EpisodeRunner(self.run.config.env, stand_in(self.run.config.instructor, self.run.folder))

    @property
    def instructor(self) -> Instructor:
        """A new one."""
        return make_instructor(stand_in(self.run.config.instructor, self.run.folder), self.task)

    def seeds(self, purpose: str, count: int) -> range:
        """Of episodes that serve no other purpose."""
        return seeds_for(purpose, self.config.seed, count)


def find_agents(context: ReportContext) -> tuple[list[PaperAgent], list[dict[str, Any]]]:
    """The agents, run again on fresh seeds; and how good all policies were that they were chosen from."""
    policies: dict[int, Policy] = dict(kept_policies(context.run, EVALUATED, BETWEEN))
    title, most = f"looking for A and B among {len(policies)} policies", most_runs(len(policies))
    processes = context.cfg.predictor.processes or PROCESSES
    with progress_bar(title, most) as step, shared_between(context.runner, processes) as run_all:
        chosen, tried = screen(policies, run_all, context.seeds("screened", SEEDS_EACH), step)
    chosen["C"] = context.run.policy_frame
    agents, seeds = [], context.seeds("flown", context.config.episodes)
    with progress_bar("rollouts of A, B and C", len(chosen)) as step:
        for name, frame in chosen.items():
            episodes = context.runner.run(policies[frame], seeds)
            agents.append(PaperAgent(name, PAPER_SUCCESS.get(name), frame, policies[frame], episodes))
            step()
    rates = [(frame, len(successes), float(np.mean(successes))) for frame, successes in sorted(tried.items())]
    return agents, [{"frame": frame, "episodes": count, "success": rate} for frame, count, rate in rates]


def report_protocol(context: ReportContext) -> dict[str, Any]:
    """What the numbers stand on."""
    config, run = context.config, context.run
    counts = {"screened": SEEDS_EACH, "flown": config.episodes, "checked": config.checked_episodes}
    return {
        "run": run.folder.name,
        "agent": run.config.agent.kind,
        "environment": context.task.name,
        "actions": "greedy",
        "horizon_steps": context.horizon_steps,
        "n_clusters": run.config.mapping.n_clusters,
        "top_fraction": context.mappings[PAPERS].top_fraction,
        "default_mapping": next(reversed(context.mappings.values())).kind,
        "seen_steps": SEEN_STEPS,
        "futures": context.cfg.predictor.futures,
        "band": context.task.explained_band[0],
        "context": context.task.context_option,
        "seed": config.seed,
        "seeds": {
            name: [seeds[0], seeds[-1]] for name, count in counts.items() if (seeds := context.seeds(name, count))
        },
        "clusterings": config.clusterings,
        "shuffles": config.shuffles,
        "resamples": config.resamples,
        **({} if (by := instructed_by(run)) is None else {"instructed_by": by}),
    }
