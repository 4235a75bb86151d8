"""gymnasium's cart-pole with a target on the rail, which moves once in an episode.

Physics and step are gymnasium's. New are the target, which is part of the state, the reward for being near it, and
``snapshot`` and ``restore``, also from one copy to another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.envs.classic_control.cartpole import CartPoleEnv

from ibe_rl.envs.cart_pole_task import (
    CART_POLE_EPISODE_STEPS,
    CART_POLE_TASK,
    ON_TARGET,
    PER_METRE,
    RAIL_END,
    RAIL_Y,
    TARGET_X,
    cart_pole_scene_path,
    scene_x,
)
from ibe_rl.task import Shape
from ibe_rl.types import Array

MOVES_FROM, MOVES_UNTIL = 120, 240
"""Range of steps in which the target moves: time to arrive before, and to arrive again after."""
TARGET_STREAM = 0xCA7  # separates target draws from gymnasium's with the same seed


@dataclass(frozen=True)
class CartPoleSnapshot:
    """All that ``step`` reads.

    Attributes:
        state: ``(4,)`` gymnasium's, in double precision.
        target: name of its place.
        moved: True once the target has moved.
        steps: in the episode so far.
        generator: state of the random generator of the target.
    """

    state: Array
    target: str
    moved: bool
    steps: int
    generator: dict[str, Any]


class CartPoleTarget(CartPoleEnv):
    """Balance the pole at the target, and follow the target when it moves.

    The state has five numbers: gymnasium's four and the target's x. With the pole upright a step is rewarded with
    up to 0.5 near the target (0 from 2.4 m), and up to another 0.5 close to it (0 from 0.4 m). The target rests for
    at least 120 steps, moves to one of the other two places at a random step, and stays there. ``info["there"]`` is
    True after 400 steps with the pole upright, if the cart is within 0.2 m of the target.
    ``reset(options={"target": "left"})`` sets the first place for one episode.

    Args:
        target: "random" to draw the first place in each episode, or "left", "center", "right".
        moving: False keeps the target at its first place.
        **kwargs: gymnasium's own, such as ``render_mode``.

    Raises:
        ValueError: for an unknown place.
    """

    task = CART_POLE_TASK
    state: Any

    def __init__(self, target: str = "random", moving: bool = True, **kwargs: Any):
        super().__init__(**kwargs)
        self._default_target, self._moving = _checked(target), moving
        self.target, self._moved, self._steps = "center", False, 0
        self._random = np.random.default_rng()
        theirs: Any = self.observation_space
        self.observation_space = spaces.Box(
            np.append(theirs.low, np.float32(-RAIL_END)), np.append(theirs.high, np.float32(RAIL_END))
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; ``options={"target": ...}`` sets the target's first place."""
        if seed is not None:
            self._random = np.random.default_rng([TARGET_STREAM, seed])
        drawn = list(TARGET_X)[self._random.integers(len(TARGET_X))]  # always, so later draws do not shift
        asked = _checked((options or {}).get("target", self._default_target))
        self.target = drawn if asked == "random" else asked
        self._moved, self._steps = False, 0
        state, _ = super().reset(seed=seed)
        return self._with_target(state), {"there": False}

    def _with_target(self, state: Array) -> Array:
        return np.append(state, np.float32(TARGET_X[self.target]))

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Step gymnasium's cart-pole, then perhaps move the target; the reward uses its new place."""
        state, _, fallen, _, _ = super().step(action)
        self._steps += 1
        self._move_target()
        distance = abs(float(state[0]) - TARGET_X[self.target])
        pay = 0.5 * max(0.0, 1.0 - distance / RAIL_END) + 0.5 * max(0.0, 1.0 - distance / (2 * ON_TARGET))
        there = not fallen and self._steps >= CART_POLE_EPISODE_STEPS and distance <= ON_TARGET
        return self._with_target(state), 0.0 if fallen else pay, fallen, False, {"there": there}

    def _move_target(self) -> None:
        """Move the target at a step drawn uniformly from the range."""
        if self._moved or not self._moving or not MOVES_FROM <= self._steps < MOVES_UNTIL:
            return
        if self._random.random() * (MOVES_UNTIL - self._steps) < 1:
            others = [name for name in TARGET_X if name != self.target]
            self.target, self._moved = others[self._random.integers(len(others))], True

    def snapshot(self) -> CartPoleSnapshot:
        """Copy all that ``step`` reads."""
        generator = dict(self._random.bit_generator.state)
        return CartPoleSnapshot(np.array(self.state, float), self.target, self._moved, self._steps, generator)

    def restore(self, snapshot: CartPoleSnapshot, noise: np.random.Generator | None = None) -> None:
        """Continue from ``snapshot``, bit for bit; call ``reset`` once before.

        Args:
            snapshot: from ``snapshot()``, also of another copy.
            noise: generator of the target's move from here on; None repeats the original's draws.
        """
        self.state, self.target = snapshot.state, snapshot.target
        self._moved, self._steps, self.steps_beyond_terminated = snapshot.moved, snapshot.steps, None
        if noise is None:
            noise = np.random.Generator(np.random.PCG64())
            noise.bit_generator.state = snapshot.generator
        self._random = noise

    def background(self) -> list[Shape]:
        """The rail and its ends, in scene units."""
        left, right = (float(scene_x(np.array(x))) for x in (-RAIL_END, RAIL_END))
        ends = [np.array([(x, RAIL_Y), (x, RAIL_Y + 1.0)]) for x in (left, right)]
        rail = np.array([(left, RAIL_Y), (right, RAIL_Y)])
        return [Shape(points, (150, 150, 160)) for points in (rail, *ends)]

    def figure(self) -> list[Shape]:
        """Cart, pole and target in their current place, in scene units."""
        (x, axle), angle = cart_pole_scene_path(np.array(self.state)).tolist(), float(self.state[2])
        target, near = float(scene_x(np.array(TARGET_X[self.target]))), PER_METRE * ON_TARGET
        cart = np.array([(x + right, axle + up) for right, up in ((-0.8, -0.4), (0.8, -0.4), (0.8, 0.4), (-0.8, 0.4))])
        tip = (x + PER_METRE * math.sin(angle), axle + PER_METRE * math.cos(angle))  # gymnasium's pole is 1 m long
        mark = np.array([(target, RAIL_Y - 0.9), (target - near, RAIL_Y - 1.9), (target + near, RAIL_Y - 1.9)])
        return [
            Shape(cart, (165, 148, 249), closed=True),
            Shape(np.array([(x, axle), tip]), (165, 148, 249), radius=0.12),
            Shape(mark, (250, 204, 21), closed=True),
        ]


def _checked(target: str) -> str:
    if target not in ("random", *TARGET_X):
        raise ValueError(f"target={target!r}: choose one of random, {', '.join(TARGET_X)}")
    return target
