"""Agents: policies that learn; they know no environment.

In: batches of steps, the sizes of observations and actions, the settings of one kind. A kind is a module here or
elsewhere; see ``Agent``.
Out: a policy that explores, a greedy one that is explained, and what was learnt as a state to resume from.
Imports: ``types``, ``config``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import gymnasium
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from ibe_rl.agents.actions import make_actions
from ibe_rl.agents.networks import GreedyPolicy
from ibe_rl.config.kinds import implementation, made
from ibe_rl.config.settings import AgentConfig
from ibe_rl.types import ConfigError


class Agent(Protocol):
    """A learner: ``policy`` explores and is what the collector runs, ``greedy`` is what is explained.

    A kind of agent is such a class. It is called with its settings, the observation size O, the space of actions, the
    frames that it will learn from, and the places in the observation that it does not see. Class attributes:
    ``settings``, a dataclass derived from ``AgentConfig``, and if need be ``check(settings, actions)``, which raises
    ``ConfigError``.
    """

    policy: TensorDictModuleBase
    greedy: GreedyPolicy

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learn from a batch ``[N, T]``; returns figures for the log, the same names every time.

        Raises:
            FloatingPointError: if the loss or the weights are no finite numbers any more.
        """

    def sync_weights(self) -> None:
        """Let ``policy`` have what has been learnt; not while it collects, which would not be repeatable."""

    def state_dict(self) -> dict[str, Any]:
        """All that learning goes on from, tensors and plain values."""

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of ``state_dict``, for an agent made with the same settings."""


def make_agent(
    config: AgentConfig,
    observation_size: int,
    actions: gymnasium.Space[Any],
    total_frames: int,
    state_names: Sequence[str] = (),
) -> Agent:
    """Make the agent of the kind that ``config`` is of.

    Args:
        config: of the agent.
        observation_size: O.
        actions: the environment's.
        total_frames: that it will learn from.
        state_names: of the first numbers of the observation, for ``config.ignores``.

    Raises:
        ConfigError: if the agent cannot take such actions, there is no such kind, or it is to ignore what is not there.
    """
    check_actions(config, actions)
    ignored = _ignored(config, state_names)
    agent: Agent = made("agent", config, observation_size, actions, total_frames, ignored)
    return agent


def check_agent(config: AgentConfig, state_names: Sequence[str]) -> None:
    """Refuse, before anything is made, an agent that is to ignore what is not there.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    _ignored(config, state_names)


def check_actions(config: AgentConfig, actions: gymnasium.Space[Any]) -> None:
    """Refuse, before anything is made, an agent that cannot work with the environment's actions.

    Raises:
        ConfigError: naming the actions and what is allowed.
    """
    make_actions(actions, 1.0)
    checks = getattr(implementation("agent", config.kind), "check", None)
    if checks:
        checks(config, actions)


def _ignored(config: AgentConfig, state_names: Sequence[str]) -> list[int]:
    """The places of what it ignores."""
    for name in config.ignores:
        if name not in state_names:
            raise ConfigError(f"agent.ignores={name}: allowed are {', '.join(state_names)}")
    return [list(state_names).index(name) for name in config.ignores]


__all__ = ["Agent", "GreedyPolicy", "check_actions", "check_agent", "make_agent"]
