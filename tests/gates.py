"""An environment of a user's own: a gate that opens and shuts, quick to train in, with its task apart from it."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

import ibe_rl

STEPS = 40


def rule(states: np.ndarray) -> np.ndarray:
    """Shut it where it is open, open it where it is shut."""
    return np.where(states[..., :1] > 0.2, -1.0, np.where(states[..., :1] < -0.2, 1.0, 0.0))


def any_of(_: np.ndarray) -> str:
    return "any"


def task(**changes: Any) -> ibe_rl.Task:
    declared: dict[str, Any] = {
        "name": "Gate",
        "state_names": ("width", "speed"),
        "state_units": ("m", "m/step"),
        "rule": rule,
        "instruction_values": (-1.0, 0.0, 1.0),
        "phrases": (ibe_rl.Phrases("staying", "{degree}shutting", "{degree}opening", ((0.2, ""),)),),
        "context": any_of,
        "contexts": ("any",),
        "context_option": "",
        "success_key": "success",
        "explained": (0,),
        "explained_band": (0.05,),
        "max_episode_steps": STEPS,
    }
    return ibe_rl.Task(**declared | changes)


class Gate(gymnasium.Env[np.ndarray, int]):
    """States (2,) float64; no task, no time limit, no spec."""

    observation_space = spaces.Box(-5, 5, (2,), np.float64)
    action_space = spaces.Discrete(3)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.state = np.array([self.np_random.uniform(-1, 1), 0.0])
        return self.state.copy(), {}

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict]:
        speed = 0.7 * self.state[1] + 0.05 * (int(action) - 1)
        self.state = np.array([np.clip(self.state[0] + speed, -2, 2), speed])
        return self.state.copy(), -abs(float(self.state[0])), False, False, {}


class Closed(Gate):
    """Cannot be copied, as it holds what only one process has."""

    def __init__(self) -> None:
        self.lock = (one for one in ())
