"""Refuses settings that cannot work together before anything is created."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.agents import check_actions, check_agent
from ibe_rl.agents.encoder import has_images
from ibe_rl.collect.check import check_collect
from ibe_rl.config.command_line import is_sweep
from ibe_rl.config.settings import TrainConfig
from ibe_rl.envs.trial import try_out
from ibe_rl.envs.wrappers import task_of
from ibe_rl.instructors import check_instructor
from ibe_rl.predict import check_predictor, is_learnt
from ibe_rl.runtime.apps import load_app
from ibe_rl.task import Task
from ibe_rl.training.instruction_reward import check_instruction_reward
from ibe_rl.types import ConfigError
from ibe_rl.vocabulary.listener import Metric
from ibe_rl.vocabulary.rule_reads import check_dimensions
from ibe_rl.vocabulary.tracker import check_refreshing

MOST_BYTES = 4_000_000_000
"""Of a batch, of the log and of a replay buffer, with images."""
TAKEN = ("train/", "eval/", "ibe/", "time/")
"""Beginnings of the columns of metrics.csv that are not of a metric of one's own."""


def check_columns(metrics: Iterable[tuple[str, Metric]]) -> None:
    """Refuse metrics of one's own, with their names, that would write the columns of others.

    Raises:
        ConfigError: naming the metric and the column.
    """
    seen = {"frames"}
    for name, metric in metrics:
        for column in metric.columns:
            if column in seen or column.startswith(TAKEN):
                raise ConfigError(f"metrics.{name}: its column {column} is taken; allowed is another one, as {name}/x")
            seen.add(column)


def _check_log(cfg: TrainConfig, task: Task) -> None:
    """Refuse a log that does not hold the longest episode with its last state, or a whole batch."""
    collect, steps = cfg.collect, task.max_episode_steps
    batch = collect.processes * collect.envs_per_process * collect.steps_per_batch
    for least, what in ((steps + 1, f"an episode has up to {steps:,} steps"), (batch, f"a batch has {batch:,} frames")):
        if cfg.log.capacity_frames < least:
            raise ConfigError(f"log.capacity_frames={cfg.log.capacity_frames}: {what}; allowed is at least {least}")


def check_run(cfg: TrainConfig, env: gymnasium.Env[Any, Any]) -> list[str]:
    """Refuse settings that cannot work.

    Args:
        cfg: of the run.
        env: one of its environments, which is reset.

    Returns:
        Notes for the user on settings that look odd but may work.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    task = task_of(env)
    if not is_sweep() and (cfg.runs_at_once or cfg.runs_on):
        raise ConfigError(f"runs_at_once={cfg.runs_at_once}, runs_on={cfg.runs_on}: allowed only in a sweep (-m)")
    check_collect(cfg.collect)
    _check_memory(cfg, task)
    _check_log(cfg, task)
    check_agent(cfg.agent, task.state_names, task.parts)
    check_actions(cfg.agent, env.action_space)
    check_instructor(cfg.instructor, cfg.collect, task)
    check_refreshing(cfg, task)
    check_instruction_reward(cfg)
    if task.words is not None and cfg.obedience.judge != "none":
        raise ConfigError(
            f"obedience.judge={cfg.obedience.judge} with an instructor's words: allowed is none, it compares numbers"
        )
    if cfg.report:
        load_app("report=true").check_report(cfg, task)
    check_predictor(cfg.predictor, cfg.instructor, env)
    notes = [*try_out(cfg.env, not is_learnt(cfg.predictor)), *check_dimensions(cfg.mapping, task, env)]
    if not task.judges_success:
        notes.append(f"{cfg.env.id} does not report success, so no episode counts as one")
    return notes


def _check_memory(cfg: TrainConfig, task: Task) -> None:
    """Refuse images that would fill the memory or the disk."""
    if not has_images(task.parts):
        return
    size, kept = 4 * task.observation_size, task.percept_size * np.dtype(task.percept_type).itemsize
    environments = cfg.collect.processes * cfg.collect.envs_per_process
    asked = {
        "collect.steps_per_batch": (cfg.collect.steps_per_batch, 2 * environments * size),
        "log.capacity_frames": (cfg.log.capacity_frames, kept),
        "agent.buffer_frames": (getattr(cfg.agent, "buffer_frames", 0), 2 * task.percept_size),
    }
    for key, (frames, bytes_each) in asked.items():
        if frames * bytes_each > MOST_BYTES:
            raise ConfigError(
                f"{key}={frames}: with observations of {task.percept_size:,} numbers it takes "
                f"{frames * bytes_each / 1e9:.0f} GB; allowed is at most {MOST_BYTES // bytes_each}, or a smaller image"
            )
