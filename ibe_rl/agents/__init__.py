"""Agents: policies that learn; they know no environment.

In: batches of steps, observation size, action space, the settings of one kind. A kind is a module here or
elsewhere; see ``Agent``.
Out: an exploring policy, a greedy one that is explained, and a state to resume from.
Imports: ``types``, ``task``, ``config``.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import Any, Protocol

import gymnasium
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from ibe_rl.agents.actions import make_actions
from ibe_rl.agents.encoder import has_images
from ibe_rl.agents.equivariant import MirroredSpaces
from ibe_rl.agents.networks import GreedyPolicy
from ibe_rl.config.kinds import implementation, made
from ibe_rl.config.settings import AgentConfig
from ibe_rl.task import NUMBERS, Part
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import ConfigError

MOST_UNITS = 100_000
"""Of a layer."""


class Agent(Protocol):
    """A learner: ``policy`` explores and collects experience, ``greedy`` is evaluated and explained.

    A kind of agent is such a class. Its constructor takes its settings, the observation size O, the action space, the
    total number of frames, the indices of the observation that are hidden from it, and optionally ``parts``, what the
    leading numbers of the observation are (``ibe_rl.task.Part``); without it images are refused; and optionally
    ``mirror``, what a mirror image does to observations and actions (``MirroredSpaces``). Class attributes:
    ``settings``, a dataclass derived from ``AgentConfig``, and optionally ``check(settings, actions)``, which raises
    ``ConfigError``.
    """

    policy: TensorDictModuleBase
    greedy: GreedyPolicy

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from a batch ``[N, T]``; returns metrics for the log, the same names every time.

        Raises:
            FloatingPointError: if the loss or the weights are NaN or infinite.
        """

    def sync_weights(self) -> None:
        """Copy the learnt weights to ``policy``; for reproducibility not while it collects."""

    def state_dict(self) -> dict[str, Any]:
        """All that learning continues from: tensors and plain values."""

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``, for an agent made with the same settings."""


def make_agent(
    config: AgentConfig,
    observation_size: int,
    actions: gymnasium.Space[Any],
    total_frames: int,
    state_names: Sequence[str] = (),
    parts: Sequence[Part] = (),
    mirror: Mirror | None = None,
) -> Agent:
    """Make the agent of the kind that ``config`` names.

    Args:
        config: of the agent.
        observation_size: O.
        actions: action space of the environment.
        total_frames: length of the training.
        state_names: names of the state dimensions, for ``config.ignores``.
        parts: of the percept; none where the observation begins with the state.
        mirror: that the environment declares; used with ``config.mirror``.

    Raises:
        ConfigError: if the kind is unknown, cannot take such actions, or is to ignore an unknown dimension.
    """
    check_actions(config, actions)
    check_agent(config, state_names, parts)
    ignored = [list(state_names).index(name) for name in config.ignores]
    parts = parts or ([Part("", NUMBERS, (len(state_names),))] if state_names else [])
    more: dict[str, Any] = {"parts": parts} if takes(config, "parts") else {}
    if config.mirror and mirror:
        more["mirror"] = MirroredSpaces(mirror.of_observations(state_names), mirror.of_actions())
    agent: Agent = made("agent", config, observation_size, actions, total_frames, ignored, **more)
    return agent


def check_agent(config: AgentConfig, state_names: Sequence[str], parts: Sequence[Part] = ()) -> None:
    """Refuse an agent that is to ignore what it does not see, cannot read images, or whose layers have no width.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    if not all(1 <= width <= MOST_UNITS for width in config.hidden):
        raise ConfigError(f"agent.hidden={config.hidden}: allowed are widths of 1 to {MOST_UNITS}")
    if config.mirror and any(width % 2 for width in config.hidden):
        raise ConfigError(f"agent.hidden={config.hidden}: with agent.mirror=true allowed are even widths")
    if parts and config.ignores:
        raise ConfigError(
            f"agent.ignores={list(config.ignores)} with env.task.state: allowed is [], as the agent does not see the "
            "state but the observation; env.task.observes chooses from a Dict"
        )
    for name in config.ignores:
        if name not in state_names:
            raise ConfigError(f"agent.ignores={name}: allowed are {', '.join(state_names)}")
    if has_images(parts) and not takes(config, "parts"):
        raise ConfigError(
            f"agent={config.kind}: its constructor takes no parts, so it cannot tell an image from numbers; allowed "
            "are observations without images"
        )


def takes(config: AgentConfig, argument: str) -> bool:
    """Whether the constructor of the agent's kind takes this argument."""
    return argument in signature(implementation("agent", config.kind)).parameters


def check_actions(config: AgentConfig, actions: gymnasium.Space[Any]) -> None:
    """Refuse an agent that cannot work with the environment's actions.

    Raises:
        ConfigError: naming the actions and what is allowed.
    """
    make_actions(actions, 1.0)
    checks = getattr(implementation("agent", config.kind), "check", None)
    if checks:
        checks(config, actions)


__all__ = ["Agent", "GreedyPolicy", "check_actions", "check_agent", "make_agent", "takes"]
