"""A bead on a wire that shall come to 0: without chance, with masks, for agents that remember or ask for masks."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl.task import Phrases, Task
from ibe_rl.types import Array

BEAD_ID = "Bead-v0"


def to_zero(states: Array) -> Array:
    """Left or right, towards 0; 0 near it."""
    place = states[..., :1]
    return np.where(np.abs(place) > 0.2, -np.sign(place), 0.0)


BEAD_TASK = Task(
    name="Bead",
    state_names=("x", "v"),
    state_units=("", ""),
    rule=to_zero,
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(Phrases("staying", "going {degree}left", "going {degree}right", ((0.15, "slightly "), (0.4, ""))),),
    context=lambda _: "any",
    contexts=("any",),
    context_option="",
    success_key="success",
    explained=(0,),
    explained_band=(0.05,),
    max_episode_steps=30,
)


class Bead(gymnasium.Env[Array, int]):
    """Actions 0, 1 and 2 push to the left, not at all and to the right; away from 0 only in every third step."""

    observation_space = spaces.Box(-np.inf, np.inf, (2,), np.float32)
    action_space = spaces.Discrete(3)
    task = BEAD_TASK

    def __init__(self, masked: bool = True):
        self.masked = masked

    def __getattr__(self, name: str) -> Any:
        if name == "action_masks" and self.__dict__.get("masked"):
            return self._masks
        raise AttributeError(name)

    def _masks(self) -> Array:
        free = self.t % 3 == 0
        return np.array([self.x > 0 or free, True, self.x < 0 or free])

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=seed)
        self.t, self.v = 0, 0.0
        self.x = float(self.np_random.uniform(0.5, 1) * self.np_random.choice([-1, 1]))
        return self._seen(), {}

    def step(self, action: int) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        assert not self.masked or self._masks()[action], f"{action} is masked"
        self.t += 1
        self.v = 0.9 * self.v + 0.02 * (action - 1)
        self.x = float(np.clip(self.x + self.v, -2, 2))
        return self._seen(), 1 - abs(self.x), False, False, {"success": abs(self.x) < 0.2}

    def _seen(self) -> Array:
        return np.array([self.x, self.v], np.float32)


gymnasium.register(BEAD_ID, Bead, max_episode_steps=30)
