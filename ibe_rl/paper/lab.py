"""What all experiments share: a run, its settings, environments to fly in; and the agents A, B and C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ibe_rl.checkpoint import BETWEEN, EVALUATED
from ibe_rl.command_line import choices
from ibe_rl.config import ExplainConfig, FiguresConfig, MappingConfig
from ibe_rl.data import ConfigError, Episode, Instructor, Policy, Task
from ibe_rl.evaluation import TrainedRun
from ibe_rl.evaluation.flights import SEEDS_EACH, seeds_for
from ibe_rl.evaluation.moments import AT_ONCE, SEEN_STEPS
from ibe_rl.evaluation.runs import kept_policies
from ibe_rl.evaluation.waiting import waiting
from ibe_rl.instruct import make_instructor
from ibe_rl.paper.agents import PAPER_SUCCESS, Skilled, most_flights, screen
from ibe_rl.paper.words import PAPER, variants
from ibe_rl.play import play

DEFAULT_MAPPING = "axis"
"""Held against the paper's where the run itself speaks in the paper's."""


@dataclass(frozen=True)
class Lab:
    """A run and the settings of its experiments.

    Raises:
        ConfigError: if its environment does not declare what the experiments need.
    """

    run: TrainedRun
    cfg: ExplainConfig

    def __post_init__(self) -> None:
        task = self.run.task
        missing = [name for name in ("motion", "first_contact", "scene_path") if getattr(task, name) is None]
        if missing:
            raise ConfigError(
                f"task=figures: {task.name} does not declare {', '.join(missing)}; allowed is one that does"
            )

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
    def _envs(self) -> list[Any]:
        return [self.run.make_env() for _ in range(AT_ONCE)]

    @property
    def instructor(self) -> Instructor:
        """One that begins anew."""
        return make_instructor(self.run.config.instructor.kind, self.task)

    def seeds(self, purpose: str, count: int) -> range:
        """Of episodes that are flown for nothing else."""
        return seeds_for(purpose, self.config.seed, count)

    def fly(self, policy: Policy, seeds: Sequence[int]) -> list[Episode]:
        """Fly a greedy episode for each seed."""
        return play(self._envs, policy, self.instructor, seeds)


def find_agents(lab: Lab) -> tuple[list[Skilled], list[dict[str, Any]]]:
    """The agents, flown again on fresh seeds; and how good all policies were that they were chosen from."""
    policies: dict[int, Policy] = dict(kept_policies(lab.run, EVALUATED, BETWEEN))
    with waiting(f"looking for A and B among {len(policies)} policies", most_flights(len(policies))) as step:
        chosen, tried = screen(policies, lab.fly, lab.seeds("screened", SEEDS_EACH), step)
    chosen["C"] = lab.run.policy_frame
    agents, seeds = [], lab.seeds("flown", lab.config.episodes)
    with waiting("A, B and C fly again", len(chosen)) as step:
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
        "band": lab.task.explained_band,
        "context": lab.task.context_option,
        "seed": config.seed,
        "seeds": {name: [seeds[0], seeds[-1]] for name, count in counts.items() if (seeds := lab.seeds(name, count))},
        "clusterings": config.clusterings,
        "shuffles": config.shuffles,
        "resamples": config.resamples,
    }
