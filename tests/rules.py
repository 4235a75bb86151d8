"""What somebody declares of gymnasium's CartPole and Pendulum, for tests; some of it wrong on purpose."""

from typing import Any

import numpy as np

from ibe_rl.config.settings import TaskConfig
from ibe_rl.config.task_parts import PhrasesConfig
from ibe_rl.task import Shape
from ibe_rl.types import Array

NO_FUNCTION = 3
WORDS = PhrasesConfig("standing", "going {degree}left", "going {degree}right")


def declared(**changes: Any) -> TaskConfig:
    settings: dict[str, Any] = {
        "name": "Cart-pole",
        "rule": "rules:go_to_middle",
        "phrases": [WORDS],
        "explained": ["state_0"],
        "explained_band": [0.1],
    }
    return TaskConfig(**{**settings, **changes})


def go_to_middle(states: Array) -> Array:
    return np.sign(np.round(-states[..., :1])).astype(np.float32)


class GoTo:
    """The same as a small class."""

    def __init__(self) -> None:
        self.middle = 0.0

    def __call__(self, states: Array) -> Array:
        return go_to_middle(states - self.middle)


def both(states: Array) -> Array:
    return np.stack([np.sign(states[..., 0]), np.sign(states[..., 2])], axis=-1)


def too_loud(states: Array) -> Array:
    return np.full((*states.shape[:-1], 1), 7.0)


def flat(states: Array) -> Array:
    return np.sign(states[..., 0])


def fails(_: Array) -> Array:
    raise IndexError("no such column")


def stood(state: Array, terminated: bool, truncated: bool) -> bool:
    return truncated and not terminated and bool(abs(state[2]) < 0.2)


def side(state: Array) -> str:
    return "left" if state[0] < 0 else "right"


def dot(game: Any) -> list[Shape]:
    return [Shape(np.array([[game.state[0], 0.0]]), (1, 2, 3))]
