"""A walker on a line of 21 places that observes whatever space is asked for, for tests."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from ibe_rl.config.settings import EnvConfig, TaskConfig
from ibe_rl.config.task_parts import PhrasesConfig
from ibe_rl.envs.make import make_env
from ibe_rl.types import Array

PLACES, LIMIT = 21, 30
FLAT = spaces.Box(-np.inf, np.inf, (2,), np.float32)
WORD = spaces.Text(5)
KINDS: dict[str, Any] = {
    "box": FLAT,
    "row": spaces.Box(-np.inf, np.inf, (1, 2), np.float32),
    "image": spaces.Box(0, 255, (6, 8, 3), np.uint8),
    "channels": spaces.Box(0, 255, (3, 6, 8), np.uint8),
    "gray": spaces.Box(0, 255, (6, 8), np.uint8),
    "discrete": spaces.Discrete(PLACES, start=3),
    "multidiscrete": spaces.MultiDiscrete([PLACES, 2]),
    "multibinary": spaces.MultiBinary(5),
    "dict": spaces.Dict(goal=spaces.Box(-1, 1, (1,)), here=FLAT, way=spaces.Discrete(2)),
    "tuple": spaces.Tuple((FLAT, spaces.Discrete(2))),
    "mixed": spaces.Dict(picture=spaces.Box(0, 255, (6, 8, 3), np.uint8), speed=spaces.Box(-1, 1, (1,))),
    "words": spaces.Dict(here=FLAT, mission=WORD),
    "camera": spaces.Box(0, 255, (36, 48, 3), np.uint8),
}
"""Spaces by name. Flattened they have ``SIZES`` numbers."""
SIZES = {"box": 2, "row": 2, "image": 144, "channels": 144, "gray": 48, "discrete": 21, "multidiscrete": 23}
SIZES |= {"multibinary": 5, "dict": 5, "tuple": 4, "mixed": 145}
STATEFUL = [name for name in SIZES if name not in ("box", "row")]


class Walker(gymnasium.Env[Any, Any]):
    """Walks left, not at all, or right, and drifts by chance; observes where it is."""

    action_space = spaces.Discrete(3)

    def __init__(self, obs: str = "dict"):
        self.obs, self.observation_space = obs, KINDS[obs]

    def seen(self) -> Any:
        picture = np.zeros((6, 8, 3), np.uint8)
        picture[self.place // 8, self.place % 8] = 255, 100, self.place
        flat = np.array([self.place / 10 - 1, self.speed], np.float32)
        way = int(self.place > 10)
        observations = {
            "box": flat,
            "row": flat[None],
            "image": picture,
            "channels": picture.transpose(2, 0, 1),
            "gray": picture[..., 2],
            "discrete": self.place + 3,
            "multidiscrete": np.array([self.place, way]),
            "multibinary": np.array([int(bit) for bit in f"{self.place:05b}"], np.int8),
            "dict": {"goal": np.zeros(1, np.float32), "here": flat, "way": way},
            "tuple": (flat, way),
            "mixed": {"picture": picture, "speed": flat[1:]},
            "camera": picture.repeat(6, axis=0).repeat(6, axis=1),
            "words": {"here": flat, "mission": "home"},
        }
        return observations[self.obs]

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.place, self.speed = int(self.np_random.integers(PLACES)), 0.0
        return self.seen(), {}

    def step(self, action: Any) -> Any:
        self.speed = float(action - 1 + self.np_random.integers(-1, 2)) / 2
        self.place = int(np.clip(self.place + round(2 * self.speed), 0, PLACES - 1))
        return self.seen(), -abs(self.place - 10) / 10, False, False, {}


gymnasium.register("Walker-v0", Walker, max_episode_steps=LIMIT)


def place_and_speed(game: Any, seen: Any) -> Array:
    """The state: position from -1 to 1, and speed."""
    assert seen is not None
    return np.array([game.place / 10 - 1, game.speed])


def only_seen(_: Any, seen: Any) -> Array:
    """The same, read from the observation alone."""
    return np.array(seen["here"])


def a_table(*_: Any) -> Array:
    return np.zeros((1, 2))


def fails(_: Any, seen: Any) -> Array:
    return np.array(seen["nowhere"])


def to_middle(states: Array) -> Array:
    return -np.sign(np.round(states[..., :1], 1))


def walker_config(obs: str, **changes: Any) -> EnvConfig:
    """An environment with a declared task; ``changes`` are of the task."""
    task: dict[str, Any] = {
        "name": "Walker",
        "rule": "walker:to_middle",
        "state": "walker:place_and_speed" if obs not in ("box", "row") else None,
        "phrases": [PhrasesConfig("staying", "going {degree}left", "going {degree}right")],
        "explained": ["x"],
        "explained_band": [0.1],
        "state_names": ["x", "v"],
    }
    return EnvConfig("walker:Walker-v0", {"obs": obs}, TaskConfig(**{**task, **changes}))


def walker(obs: str, **changes: Any) -> Any:
    return make_env(walker_config(obs, **changes))
