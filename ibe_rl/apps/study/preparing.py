"""From a run to the stimuli of a study: open it, fly, choose, explain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ibe_rl.apps.paper.report_context import hidden_goal_env
from ibe_rl.apps.study.arms import Speaker, instructor_of
from ibe_rl.apps.study.flights import FlownAgent, check_same_task, earlier_in, fly
from ibe_rl.apps.study.scenes import scene_of
from ibe_rl.apps.study.sides import pairs_of
from ibe_rl.apps.study.stimuli import (
    BY_LOT,
    TRIES_EACH_STIMULUS,
    balanced_episodes,
    check_until,
    cut_episodes,
    stimuli_of,
    told_otherwise,
)
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import EnvConfig, ExplainConfig
from ibe_rl.envs.make import make_env
from ibe_rl.evaluation.progress_bar import progress_bar
from ibe_rl.evaluation.rollouts import seeds_for
from ibe_rl.evaluation.run_predictor import as_trained, predictor_of
from ibe_rl.evaluation.runs import open_trained
from ibe_rl.evaluation.trained_run import TrainedRun
from ibe_rl.runtime.installation import shipped
from ibe_rl.types import ConfigError
from ibe_rl.view.clip import FRAMES_PER_S

_DEMO = "demo"
_MS_PER_S = 1000.0


@dataclass(frozen=True)
class StimuliPlan:
    """What is asked for.

    Attributes:
        run: folder of the run; ``demo`` is the one that comes along; None: the newest below ``runs/``.
        other: folder of a second run to compare with; None: an earlier policy of the same run.
        count: how many stimuli.
        flights: flown beforehand.
        pace: 1 is as fast as the environment, 0.5 half as fast.
        seed: of everything.
        until: see ``check_until``.
        frames: that people see.
        told_otherwise: whether it is told something else at the last of them.
    """

    run: str | None
    other: str | None
    count: int
    flights: int
    pace: float
    seed: int
    until: str | None
    frames: int
    told_otherwise: bool = False


@dataclass(frozen=True)
class OpenedAgent:
    """A run and the settings with which it explains itself."""

    run: TrainedRun
    config: ExplainConfig


def opened(run: str | None) -> OpenedAgent:
    """Open a run, also the one that comes along.

    Raises:
        ConfigError: if it is none.
    """
    if run == _DEMO and not Path(_DEMO).exists():
        run = str(shipped(_DEMO))
    found = open_trained(run)
    return OpenedAgent(found, as_trained(composed("explain", []), found, named=()))


def stimuli_from(plan: StimuliPlan) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Stimuli of one agent, and what they were made from.

    Raises:
        ConfigError: if the run does not suit.
    """
    torch.set_num_threads(1)
    agent = opened(plan.run)
    run = agent.run
    until = check_until(plan.until or (BY_LOT if plan.told_otherwise else None), run.task)
    flown, random = fly(run, plan.flights, plan.seed), np.random.default_rng(plan.seed)
    scene = scene_of(run.task, flown.episodes, plan.frames + run.horizon_steps)
    hidden = hidden_goal_env(run.config.env, run.task)
    seeds = seeds_for("foretold", plan.seed, TRIES_EACH_STIMULUS * plan.count)
    env = make_env(hidden)
    found = cut_episodes(env, run.task, run.policy, instructor_of(run), seeds, run.horizon_steps, until, plan.frames)
    if plan.told_otherwise:
        found = told_otherwise(found, env, run.task, run.policy, instructor_of(run))
    with progress_bar("episodes", plan.count) as step:
        chosen = balanced_episodes(found, scene, plan.count, random, step)
    with _speaker(agent, flown, plan.seed, hidden) as speaker, progress_bar("explanations", plan.count) as step:
        pace_ms = _frame_ms(env.metadata, plan.pace)
        made = stimuli_of(chosen, speaker, flown.observer, scene, pace_ms, random, step)
    env.close()
    return made, {**_about(plan, flown, pace_ms), "until": until}


def pairs_from(plan: StimuliPlan) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Stimuli of two agents, and what they were made from.

    Raises:
        ConfigError: if the runs do not suit.
    """
    torch.set_num_threads(1)
    agent = opened(plan.run)
    second = opened(plan.other) if plan.other is not None else replace(agent, run=earlier_in(agent.run))
    check_same_task(agent.run, second.run, str(plan.other))
    both = [(one, fly(one.run, plan.flights, plan.seed)) for one in (agent, second)]
    if both[0][1].skill == both[1][1].skill:
        raise ConfigError(f"other={plan.other}: both agents are equally good; allowed is a better or a worse one")
    (better, skilled), (other, less) = sorted(both, key=lambda one: one[1].skill, reverse=True)
    task, random = agent.run.task, np.random.default_rng(plan.seed)
    scene = scene_of(task, [*skilled.episodes, *less.episodes], task.max_episode_steps, goal_may_show=True)
    env = agent.run.make_env()
    pace_ms, seeds = _frame_ms(env.metadata, plan.pace), seeds_for("foretold", plan.seed, plan.count)
    env.close()
    with (
        _speaker(better, skilled, plan.seed) as first,
        _speaker(other, less, plan.seed) as worse,
        progress_bar("pairs of episodes", plan.count) as step,
    ):
        made = pairs_of(first, worse, scene, seeds, pace_ms, random, step)
    return made, {**_about(plan, skilled, pace_ms), "other": _about(plan, less, pace_ms)}


@contextmanager
def _speaker(agent: OpenedAgent, flown: FlownAgent, seed: int, env: EnvConfig | None = None) -> Iterator[Speaker]:
    config = agent.config
    with predictor_of(agent.run, config.predictor, seed, env) as predictor:
        yield Speaker(agent.run, predictor, flown.paper, config.predictor.futures, config.min_confidence)


def _frame_ms(metadata: dict[str, Any], pace: float) -> float:
    return round(_MS_PER_S / float(metadata.get("render_fps") or FRAMES_PER_S) / pace, 3)


def _about(plan: StimuliPlan, flown: FlownAgent, step_ms: float) -> dict[str, Any]:
    run, (success, mean_return) = flown.run, flown.skill
    return {
        "run": run.folder.resolve().name,
        "environment": run.task.name,
        "policy_frame": run.policy_frame,
        "vocabulary_frame": run.mapping_frame,
        "horizon_steps": run.horizon_steps,
        "ahead_s": step_ms * run.horizon_steps / _MS_PER_S,
        "until": None,
        "seed": plan.seed,
        "flights": plan.flights,
        "success": success,
        "mean_return": mean_return,
        "paper_vocabulary": flown.paper is not None,
    }
