"""Settings of an external agent, trained elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ibe_rl.config.limits import setting
from ibe_rl.config.settings import AgentConfig
from ibe_rl.types import ConfigError


@dataclass
class ExternalPolicyConfig(AgentConfig):
    """An agent trained elsewhere; a run folder describes it but never says where to load it from."""

    kind: str = setting("guest", kept=True)
    sees_instruction: bool | None = None  # None: as it declares
    frame_stack: int | None = setting(None, low=1)  # observations that it reads at once
    vec_normalize: str | None = None  # what normalised its observations, for messages
    made_from: str = "an object in Python"  # for messages


class ExternalAgent:
    """Placeholder for an agent that no run folder holds."""

    kind, settings = "guest", ExternalPolicyConfig

    @staticmethod
    def check(config: ExternalPolicyConfig, actions: Any) -> None:  # noqa: ARG004 - as of the other kinds
        """Refuse to train it.

        Raises:
            ConfigError: always.
        """
        raise ConfigError(
            f"agent=guest: it was trained elsewhere ({config.made_from}); allowed is an agent that learns"
        )
