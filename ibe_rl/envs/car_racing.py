"""gymnasium's CarRacing, which is seen as an image, with its task: which way the road goes ahead.

The state is read from the game. Lengths are metres, angles radians, and to the right is positive.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.box2d.car_racing import CarRacing
from gymnasium.wrappers import MaxAndSkipObservation

from ibe_rl.types import Array

FRAMES_PER_ACTION, RACE_FRAME_S = 4, 0.02
"""Frames of the game for which an action stands, and the time of one."""

AHEAD_TILES = 8
"""How many tiles of the road (3.5 m each) the instructor looks ahead."""
STRAIGHT_ROAD = 0.15
"""Within this angle the road ahead counts as straight."""
HALF_ROAD = 20 / 3
LEAST_TILES = 30
"""Tiles that the car has to pass in an episode."""
CAR_HEADING, BEND, FROM_MIDDLE, TURN_RATE, TILES_PASSED = 0, 1, 2, 4, 5


def make_steered_car(**settings: Any) -> gymnasium.Env[Any, Any]:
    """The game, with an action every ``FRAMES_PER_ACTION`` frames; ``settings`` are its own."""
    return MaxAndSkipObservation(CarRacing(**settings), skip=FRAMES_PER_ACTION)


gymnasium.register("CarRacingSteered-v0", make_steered_car, max_episode_steps=100)


def car_on_road(env: Any, observation: Any) -> Array:
    """Where the car is on its road.

    Returns:
        ``(6,)``: heading since the start, angle to the road ahead, distance from its middle, speed, turn rate, tiles
        passed.
    """
    del observation
    body, road = env.car.hull, np.array(env.track)
    place, (angle, start) = np.array(body.position), (body.angle, road[0, 1])
    nearest = int(np.hypot(*(road[:, 2:] - place).T).argmin())
    aim = road[(nearest + AHEAD_TILES) % len(road), 2:] - place
    speed = float(_forward(angle) @ np.array(body.linearVelocity))
    return np.array(
        [
            start - angle,
            np.arctan2(_right(angle) @ aim, _forward(angle) @ aim),
            _right(road[nearest, 1]) @ (place - road[nearest, 2:]),
            speed,
            -body.angularVelocity,
            env.tile_visited_count,
        ]
    )


def _forward(angle: float) -> Array:
    return np.array([-np.sin(angle), np.cos(angle)])


def _right(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def follow_road(states: Array) -> Array:
    """Which way to steer: states ``(..., 6)`` to ``(..., 1)`` float32, -1 left, +1 right, 0 straight on."""
    bend = states[..., [BEND]]
    return np.where(bend > STRAIGHT_ROAD, 1.0, np.where(bend < -STRAIGHT_ROAD, -1.0, 0.0)).astype(np.float32)


def on_the_road(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the time is over with ``LEAST_TILES`` behind the car, which is on the road."""
    return (
        truncated
        and not terminated
        and bool(state[TILES_PASSED] >= LEAST_TILES and abs(state[FROM_MIDDLE]) < HALF_ROAD)
    )


def turning(states: Array) -> Array:
    """States ``(..., 6)`` to how far ``(..., 1)`` the car turns in one step at its turn rate."""
    return states[..., [TURN_RATE]] * FRAMES_PER_ACTION * RACE_FRAME_S
