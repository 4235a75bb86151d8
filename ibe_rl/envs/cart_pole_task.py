"""The task of the cart-pole with a target: rule, names, units, phrases, places, scene.

Units are gymnasium's: metres, seconds, radians; x is 0 in the middle of the rail, which ends at 2.4 m to each side.
"""

from __future__ import annotations

import numpy as np

from ibe_rl.task import DEGREES, Phrases, Task
from ibe_rl.task.mirror import Mirror
from ibe_rl.types import Array

TARGET_X: dict[str, float] = {"left": -1.2, "center": 0.0, "right": 1.2}
CART_POLE_EPISODE_STEPS = 400
ON_TARGET = 0.2
"""Within this distance of the target, in m, the instruction is to stay."""
RAIL_END = 2.4
CART_STEP_S = 0.02

CART_X, CART_VX, ANGLE, CART_TARGET = 0, 1, 2, 4
PER_METRE = 4.0
"""Scene units per metre; the scene has the size of the others, so lines and labels look alike."""
SCENE_WIDTH, SCENE_HEIGHT, RAIL_Y, AXLE_Y = 22.0, 11.0, 3.0, 3.5


def cart_pole_instruction(states: Array) -> Array:
    """Which way to go: states ``(..., 5)`` to ``(..., 1)`` float32, -1 right of the target, +1 left of it."""
    offset = cart_pole_goal_offset(states)
    instruction = np.where(offset < -ON_TARGET, -1.0, np.where(offset > ON_TARGET, 1.0, 0.0))
    return instruction.astype(np.float32)


def place_of(state: Array) -> str:
    """Name the place of the target in ``state`` ``(5,)``."""
    return min(TARGET_X, key=lambda name: abs(TARGET_X[name] - float(state[CART_TARGET])))


def cart_pole_motion(states: Array) -> Array:
    """States ``(..., 5)`` to the change ``(..., 1)`` of x in one step at the current velocity, in m."""
    return CART_STEP_S * states[..., CART_VX, None]


def cart_pole_goal_offset(states: Array) -> Array:
    """States ``(..., 5)`` to how far ``(..., 1)`` right of the cart the target lies, in m."""
    return (states[..., CART_TARGET] - states[..., CART_X])[..., None]


def scene_x(x: Array) -> Array:
    """Metres on the rail to scene units."""
    return SCENE_WIDTH / 2 + PER_METRE * x


def cart_pole_scene_path(states: Array) -> Array:
    """States ``(..., 5)`` to the place of the cart's axle ``(..., 2)`` in scene units, y up."""
    x = scene_x(states[..., CART_X])
    return np.stack([x, np.full_like(x, AXLE_Y)], axis=-1)


CART_POLE_TASK = Task(
    name="Cart-pole with a moving target",
    state_names=("x", "vx", "angle", "angular_velocity", "target_x"),
    state_units=("m", "m/s", "rad", "rad/s", "m"),
    rule=cart_pole_instruction,
    instruction_values=(-1.0, 0.0, 1.0),
    phrases=(
        Phrases(
            zero="staying",
            negative="going {degree}to the left",
            positive="going {degree}to the right",
            degrees=DEGREES,
        ),
    ),
    context=place_of,
    contexts=tuple(TARGET_X),
    context_option="target",
    success_key="there",
    explained=(CART_X,),
    explained_band=(0.1,),
    max_episode_steps=CART_POLE_EPISODE_STEPS,
    explained_range=(2 * RAIL_END,),
    motion=cart_pole_motion,
    goal_offset=cart_pole_goal_offset,
    scene_path=cart_pole_scene_path,
    scene_size=(SCENE_WIDTH, SCENE_HEIGHT),
    mirror=Mirror(flipped=("x", "vx", "angle", "angular_velocity", "target_x"), actions=(1, 0)),
)
