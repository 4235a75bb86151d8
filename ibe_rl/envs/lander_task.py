"""The task of the lander with pads: rule, names, units, phrases, pads, scene.

Units are gymnasium's: x is 1 at half the width (10 m), y is 1 at half the height (20/3 m), measured from
where the legs stand on the pad; see the notes of gymnasium's Lunar Lander for the velocities.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.envs.box2d import lunar_lander as game

from ibe_rl.task import DEGREES, Phrases, Task
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import Array

PAD_X: dict[str, float] = {"left": -0.6, "center": 0.0, "right": 0.6}
MAX_EPISODE_STEPS = 1000
FLAG_DISTANCE = 0.2
"""From the middle of the pad to each flag in half widths, as in gymnasium."""

WIDTH = game.VIEWPORT_W / game.SCALE
HEIGHT = game.VIEWPORT_H / game.SCALE
PAD_Y = HEIGHT / 4
X, Y, VX, VY, LEFT_LEG, RIGHT_LEG, GOAL_X = 0, 1, 2, 3, 6, 7, 8


def lander_instruction(states: Array) -> Array:
    """Which way to fall (the paper's equation 7).

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


def lander_motion(states: Array) -> Array:
    """States ``(..., 9)`` to the change ``(..., 1)`` of x in one step at the current velocity: 0.01 vx, in half widths.

    gymnasium's vx is m/s times half the width over the frame rate; dividing by half the width once gives metres per
    step, twice gives half widths.
    """
    return states[..., [VX]] / (WIDTH / 2) ** 2


def lander_goal_offset(states: Array) -> Array:
    """States ``(..., 9)`` to how far ``(..., 1)`` right of the lander the pad's middle lies, in half widths."""
    return states[..., [GOAL_X]] - states[..., [X]]


def first_contact(states: Array) -> int:
    """The first step of states ``(T + 1, 9)`` at which a leg touches the ground; the last step if none does."""
    touching = np.flatnonzero(states[:, [LEFT_LEG, RIGHT_LEG]].any(axis=1))
    return int(touching[0]) if len(touching) else len(states) - 1


def lander_scene_path(states: Array) -> Array:
    """States ``(..., 9)`` to the place of the lander's centre ``(..., 2)`` in metres, y up."""
    x = (states[..., X] + 1.0) * WIDTH / 2
    y = states[..., Y] * HEIGHT / 2 + PAD_Y + game.LEG_DOWN / game.SCALE
    return np.stack([x, y], axis=-1)


LANDER_MIRROR = Mirror(
    flipped=("x", "vx", "angle", "angular_velocity", "goal_x"),
    swapped=(("left_leg", "right_leg"),),
    actions=(0, 3, 2, 1),  # the side engines
)

LANDER_TASK = Task(
    name="Lunar Lander with pads",
    state_names=("x", "y", "vx", "vy", "angle", "angular_velocity", "left_leg", "right_leg", "goal_x"),
    state_units=("half widths", "half heights", "5 m/s", "7.5 m/s", "rad", "2.5 rad/s", "0/1", "0/1", "half widths"),
    rule=lander_instruction,
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(
        Phrases(
            zero="falling straight down",
            negative="falling {degree}to the left",
            positive="falling {degree}to the right",
            degrees=DEGREES,
        ),
    ),
    context=pad_of,
    contexts=tuple(PAD_X),
    context_option="pad",
    success_key="landed",
    explained=(X,),
    explained_band=(0.05,),
    max_episode_steps=MAX_EPISODE_STEPS,
    explained_range=(2.0,),
    motion=lander_motion,
    goal_offset=lander_goal_offset,
    first_contact=first_contact,
    hidden_goal={"flat": True, "flags": False},
    scene_path=lander_scene_path,
    scene_size=(WIDTH, HEIGHT),
    mirror=LANDER_MIRROR,
)


def outline(body: Any) -> Array:
    """Corners ``(P, 2)`` in metres of a Box2D body's first fixture."""
    return np.array([body.transform * corner for corner in body.fixtures[0].shape.vertices])
