"""What the lander with moving pads declares of its own: rule, names, units, phrases, pads, scene.

Units are gymnasium's: x is 1 at half the width (10 m), y is 1 at half the height (20/3 m), measured from
where the legs stand on the pad; see the notes of gymnasium's Lunar Lander for the velocities.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.envs.box2d import lunar_lander as game

from ibe_rl.data import Array, Phrases, Task

PAD_X: dict[str, float] = {"left": -0.6, "center": 0.0, "right": 0.6}
MAX_EPISODE_STEPS = 1000
FLAG_DISTANCE = 0.2
"""From the middle of the pad to each flag, as in gymnasium's game."""

WIDTH = game.VIEWPORT_W / game.SCALE
HEIGHT = game.VIEWPORT_H / game.SCALE
PAD_Y = HEIGHT / 4
X, Y, GOAL_X = 0, 1, 8


def instruct(states: Array) -> Array:
    """Say which way to fall (the paper's equation 7).

    Args:
        states: ``(..., 9)``.

    Returns:
        ``(..., 1)`` float32: -1 right of the right flag, +1 left of the left flag, 0 between them.
    """
    offset = states[..., X] - states[..., GOAL_X]
    instruction = np.where(offset > FLAG_DISTANCE, -1.0, np.where(offset < -FLAG_DISTANCE, 1.0, 0.0))
    return instruction.astype(np.float32)[..., None]


def pad_of(state: Array) -> str:
    """Name the pad that the goal in ``state`` ``(9,)`` belongs to."""
    return min(PAD_X, key=lambda name: abs(PAD_X[name] - float(state[GOAL_X])))


def scene_path(states: Array) -> Array:
    """States ``(..., 9)`` to the place of the lander's centre ``(..., 2)`` in metres, y up."""
    x = (states[..., X] + 1.0) * WIDTH / 2
    y = states[..., Y] * HEIGHT / 2 + PAD_Y + game.LEG_DOWN / game.SCALE
    return np.stack([x, y], axis=-1)


LANDER_TASK = Task(
    name="Lunar Lander with pads",
    state_names=("x", "y", "vx", "vy", "angle", "angular_velocity", "left_leg", "right_leg", "goal_x"),
    state_units=("half widths", "half heights", "5 m/s", "7.5 m/s", "rad", "2.5 rad/s", "0/1", "0/1", "half widths"),
    rule=instruct,
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(
        Phrases(
            zero="falling straight down",
            negative="falling {degree}to the left",
            positive="falling {degree}to the right",
            degrees=((0.15, "slightly "), (0.4, "moderately "), (0.75, "")),
        ),
    ),
    context=pad_of,
    contexts=tuple(PAD_X),
    context_option="pad",
    success_key="landed",
    explained=X,
    explained_band=0.05,
    max_episode_steps=MAX_EPISODE_STEPS,
    scene_path=scene_path,
    scene_size=(WIDTH, HEIGHT),
)


def outline(body: Any) -> Array:
    """Corners ``(P, 2)`` in metres of a Box2D body's first fixture."""
    return np.array([body.transform * corner for corner in body.fixtures[0].shape.vertices])
