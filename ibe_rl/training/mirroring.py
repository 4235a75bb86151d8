"""Decides whether the agent's networks are equivariant under the mirror image that the environment declares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.agents import takes
from ibe_rl.agents.actions import discrete
from ibe_rl.config.settings import TrainConfig
from ibe_rl.task import Task
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import ConfigError

BY_RULE = ("oracle", "flawed", "silent")
"""Instructors whose instructions have a mirror image, since they follow the rule. What a person means need not."""


def with_mirror(cfg: TrainConfig, task: Task, actions: gymnasium.Space[Any]) -> TrainConfig:
    """The settings of a new run, with ``agent.mirror`` decided where it is None.

    Raises:
        ConfigError: if it is true and cannot be.
    """
    reason = _reason_against(cfg, task, actions)
    if cfg.agent.mirror and reason:
        raise ConfigError(f"agent.mirror=true: {reason}; allowed is agent.mirror=false")
    mirror = reason is None if cfg.agent.mirror is None else cfg.agent.mirror
    return replace(cfg, agent=replace(cfg.agent, mirror=mirror))


def _reason_against(cfg: TrainConfig, task: Task, actions: gymnasium.Space[Any]) -> str | None:
    """Why the agent cannot be equivariant; None: it can."""
    if task.mirror is None:
        return f"{cfg.env.id} declares no mirror image (Task.mirror)"
    if task.words is not None or cfg.instructor.kind not in BY_RULE:
        return f"instructor={cfg.instructor.kind}: what somebody's own instructions mean need not have a mirror image"
    if task.parts:
        return "it is declared of the state, and the agent perceives something else (env.task.state)"
    if not takes(cfg.agent, "mirror"):
        return f"the constructor of agent={cfg.agent.kind} takes no mirror"
    if torn := _torn(task.mirror, cfg.agent.ignores):
        return f"agent.ignores={cfg.agent.ignores}: in the mirror image {torn[0]} and {torn[1]} change places"
    if odd := [width for width in cfg.agent.hidden if width % 2]:
        return f"agent.hidden={cfg.agent.hidden}: half of the units are mirror images, and {odd[0]} is odd"
    return None if _fits(task.mirror, actions) else f"its mirror image of actions does not fit {actions}"


def _torn(mirror: Mirror, ignored: Sequence[str]) -> tuple[str, str] | None:
    """Two dimensions that change places, of which the agent ignores only one."""
    return next((pair for pair in mirror.swapped if len({*pair} & {*ignored}) == 1), None)


def _fits(mirror: Mirror, actions: gymnasium.Space[Any]) -> bool:
    if isinstance(actions, gymnasium.spaces.Discrete) and discrete(actions):
        return len(mirror.actions) == actions.n
    if not isinstance(actions, gymnasium.spaces.Box) or mirror.actions or len(mirror.action_signs) != actions.shape[0]:
        return False
    flipped = np.array(mirror.action_signs) < 0
    return bool(np.allclose(actions.low[flipped], -actions.high[flipped]))
