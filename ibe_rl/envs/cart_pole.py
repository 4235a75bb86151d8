"""gymnasium's cart-pole with a target on the rail, which moves once while it plays.

The physics and the step are gymnasium's. New are the target, which is part of the state, the reward for being near it,
and that the game can be stopped in one copy and taken up in another (snapshot, restore).
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
"""The steps between which the target moves: the cart has had time to arrive, and has time to arrive again."""
TARGET_STREAM = 0xCA7  # keeps the draws of the target apart from gymnasium's own of the same seed


@dataclass(frozen=True)
class CartPoleSnapshot:
    """All that the step of the game reads.

    Attributes:
        state: ``(4,)`` gymnasium's, in double precision.
        target: name of the place.
        moved: True once the target has moved.
        steps: since the beginning of the episode.
        generator: state of the random generator that moves the target.
    """

    state: Array
    target: str
    moved: bool
    steps: int
    generator: dict[str, Any]


class CartPoleTarget(CartPoleEnv):
    """Stand at the target with the pole upright, and go with it when it moves.

    The state has five numbers: gymnasium's four and the target's x. A step with the pole upright pays up to a half
    for how near the target is (0 from 2.4 m on), and up to a half more close to it (0 from 0.4 m on). The target
    stands still for 120 steps at least, moves to one of the other two places at a step that nobody knows, and stays
    there. ``info["there"]`` is True after 400 steps with the pole upright, if the cart is within 0.2 m of the target.
    ``reset(options={"target": "left"})`` places the target for the beginning of one episode.

    Args:
        target: "random" to draw the first place for each episode, or "left", "center", "right".
        moving: False leaves the target where it is.
        **kwargs: gymnasium's own, such as ``render_mode``.

    Raises:
        ValueError: for another place.
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
        """Begin an episode; ``options={"target": ...}`` overrides where the target is at first."""
        if seed is not None:
            self._random = np.random.default_rng([TARGET_STREAM, seed])
        drawn = list(TARGET_X)[self._random.integers(len(TARGET_X))]  # also if unused: no later draw is shifted
        asked = _checked((options or {}).get("target", self._default_target))
        self.target = drawn if asked == "random" else asked
        self._moved, self._steps = False, 0
        state, _ = super().reset(seed=seed)
        return self._with_target(state), {"there": False}

    def _with_target(self, state: Array) -> Array:
        return np.append(state, np.float32(TARGET_X[self.target]))

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Step gymnasium's game, then perhaps move the target; the reward is for the place after that."""
        state, _, fallen, _, _ = super().step(action)
        self._steps += 1
        self._move_target()
        distance = abs(float(state[0]) - TARGET_X[self.target])
        pay = 0.5 * max(0.0, 1.0 - distance / RAIL_END) + 0.5 * max(0.0, 1.0 - distance / (2 * ON_TARGET))
        there = not fallen and self._steps >= CART_POLE_EPISODE_STEPS and distance <= ON_TARGET
        return self._with_target(state), 0.0 if fallen else pay, fallen, False, {"there": there}

    def _move_target(self) -> None:
        """Each step on which it may move is as likely as any other, and at the last one it does."""
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
        """Take the game up where ``snapshot`` left it, to the last bit; call ``reset`` once before.

        Args:
            snapshot: from ``snapshot()``, also of another copy.
            noise: decides from here on when and where to the target moves; None repeats the original's draws.
        """
        self.state, self.target = snapshot.state, snapshot.target
        self._moved, self._steps, self.steps_beyond_terminated = snapshot.moved, snapshot.steps, None
        if noise is None:
            noise = np.random.Generator(np.random.PCG64())
            noise.bit_generator.state = snapshot.generator
        self._random = noise

    def background(self) -> list[Shape]:
        """The rail and its ends, for a drawing in scene units."""
        left, right = (float(scene_x(np.array(x))) for x in (-RAIL_END, RAIL_END))
        ends = [np.array([(x, RAIL_Y), (x, RAIL_Y + 1.0)]) for x in (left, right)]
        rail = np.array([(left, RAIL_Y), (right, RAIL_Y)])
        return [Shape(points, (150, 150, 160)) for points in (rail, *ends)]

    def figure(self) -> list[Shape]:
        """Cart, pole and target as they are now, for a drawing in scene units."""
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
