"""What an agent reads of an observation, and what its own training put before it: frames and statistics."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ibe_rl.agents.guest import ExternalPolicyConfig
from ibe_rl.apps.external.adapters import Adapter, InParts, KeyStatistics, Normalised, Statistics
from ibe_rl.apps.external.finding import load_statistics, statistics_of
from ibe_rl.config.settings import ExplainConfig
from ibe_rl.types import ConfigError, Episode

_FEWEST_RETURNS = 5
"""Of a training, to hold the agent's returns against."""


@dataclass(frozen=True)
class Reading:
    """What stands between the environment's observation and the agent.

    Attributes:
        sees_instruction: whether it reads the instruction after the state; None takes it from the agent.
        frames: how many observations it reads at once, as behind ``VecFrameStack``.
        statistics: that its observations are normalised with, as behind ``VecNormalize``; None: they are not.
        normalised_by: where the statistics are from, for messages.
    """

    sees_instruction: bool | None = None
    frames: int = 1
    statistics: Statistics | KeyStatistics | None = None
    normalised_by: str | None = None


def reading_of(agent: Any, cfg: ExplainConfig, config: ExternalPolicyConfig | None = None) -> Reading:
    """What an agent reads: as the settings say, else as its folder does, else as the agent shows.

    Args:
        agent: a model of stable-baselines3 that was just trained still holds its wrappers.
        cfg: of the explanation.
        config: from the agent's run folder, which never names a file to load.

    Raises:
        ConfigError: if the statistics cannot be read, or are missing.
    """
    config = config or ExternalPolicyConfig()
    wrappers = {type(one).__name__: one for one in training_wrappers(agent)}
    sees = config.sees_instruction if cfg.agent_sees_instruction is None else cfg.agent_sees_instruction
    stacks = wrappers["VecFrameStack"].stacked_obs.n_stack if "VecFrameStack" in wrappers else 1
    frames = cfg.agent_frame_stack or config.frame_stack or stacks
    if cfg.agent_vec_normalize is not None:
        return Reading(sees, frames, load_statistics(cfg.agent_vec_normalize), cfg.agent_vec_normalize)
    if "VecNormalize" in wrappers:
        return Reading(sees, frames, statistics_of(wrappers["VecNormalize"]), "its own VecNormalize")
    if config.vec_normalize is not None:
        raise ConfigError(
            f"agent_vec_normalize=null: this folder's agent read observations that were normalised by "
            f"{config.vec_normalize}; allowed is the file of VecNormalize, which you trust"
        )
    return Reading(sees, frames)


def of_parts(agent: Adapter, reading: Reading, space: gymnasium.Space[Any]) -> Adapter:
    """Put the statistics before an agent that reads observations as the environment has them.

    Raises:
        ConfigError: if they are of other observations.
    """
    if reading.statistics is None:
        return InParts(agent, space)
    if not reading.statistics.are_of(space):
        raise ConfigError(
            "agent_vec_normalize: its statistics are of observations of other shapes or keys; allowed are those of "
            f"{space!s:.200}"
        )
    return InParts(Normalised(agent, reading.statistics), space)


def training_wrappers(model: Any) -> Iterator[Any]:
    """The vector wrappers around the environment that a model of stable-baselines3 still holds, the outermost first."""
    wrapper: Any = getattr(model, "env", None)
    while hasattr(wrapper, "venv"):
        yield wrapper
        wrapper = wrapper.venv


def forgotten(name: Any, reading: Reading) -> list[str]:
    """A line if statistics lie beside the file of a model that is used without any."""
    if reading.statistics is not None or not str(name).endswith(".zip"):
        return []
    folder, stem = Path(name).parent, Path(name).stem
    beside = sorted(
        {*folder.glob("*norm*.pkl"), *folder.glob(f"{glob.escape(stem)}*.pkl"), *folder.glob("*/*norm*.pkl")}
    )
    return [
        f"note: {one} lies beside {name}; if the agent was trained with it, name it: agent_vec_normalize={one}"
        for one in beside[:1]
    ]


def compared_returns(agent: Any, episodes: Sequence[Episode]) -> list[str]:
    """A line if the agent earns much less here than at the end of its own training, which a model's file recorded."""
    trained = [float(one["r"]) for one in getattr(agent, "ep_info_buffer", None) or ()]
    if len(trained) < _FEWEST_RETURNS:
        return []
    here, there = np.mean([one.total_reward for one in episodes]), np.mean(trained)
    if there - here <= 2 * np.std(trained) + 0.01 * abs(there):
        return []
    return [
        f"note: the agent's episodes return {here:.1f} on average here, and returned {there:.1f} at the end of its own "
        "training. Something may be missing: VecNormalize (agent_vec_normalize=), VecFrameStack (agent_frame_stack=), "
        "or a wrapper of its environment"
    ]
