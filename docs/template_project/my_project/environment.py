"""A corridor: a cart is told to which side the goal lies, and learns to stop there."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl import Phrases, Task

STEPS, NEAR_M = 100, 0.3


def towards_goal(states: np.ndarray) -> np.ndarray:
    """The instructor's rule: states (..., 3) to instructions (..., 1), -1 for left, +1 for right, 0 at the goal."""
    offset = states[..., 2:3] - states[..., 0:1]
    return np.where(offset > NEAR_M, 1.0, np.where(offset < -NEAR_M, -1.0, 0.0))


def side_of(state: np.ndarray) -> str:
    """What an episode is about: where its goal lies."""
    return "left" if state[2] < 0 else "right"


TASK = Task(
    name="Corridor",
    state_names=("x", "vx", "goal"),
    state_units=("m", "m/step", "m"),
    rule=towards_goal,
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(Phrases("staying", "going {degree}left", "going {degree}right", ((0.15, "slightly "), (0.6, ""))),),
    context=side_of,
    contexts=("left", "right"),
    context_option="",
    success_key="success",
    explained=(0,),  # the words are about x, which rises where the rule says +1
    explained_band=(0.05,),
    max_episode_steps=STEPS,
)


class Corridor(gymnasium.Env[np.ndarray, int]):
    """State: position, velocity, goal. Actions: push left, do nothing, push right."""

    task = TASK
    observation_space = spaces.Box(-10, 10, (3,), np.float32)
    action_space = spaces.Discrete(3)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Begin somewhere, with the goal somewhere else."""
        super().reset(seed=seed)
        self.x, self.goal = self.np_random.uniform(-3, 3, 2)
        self.vx, self.steps = 0.0, 0
        return self._state(), {}

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Push; near the goal is good. Success is told at the end of an episode only."""
        self.vx = 0.8 * self.vx + 0.04 * (int(action) - 1)
        self.x = float(np.clip(self.x + self.vx, -5, 5))
        self.steps += 1
        ended, off = self.steps >= STEPS, abs(self.x - self.goal)
        return self._state(), -0.1 * off, False, ended, {"success": bool(ended and off < NEAR_M)}

    def _state(self) -> np.ndarray:
        return np.array([self.x, self.vx, self.goal], np.float32)


gymnasium.register("Corridor-v0", Corridor, max_episode_steps=STEPS)
