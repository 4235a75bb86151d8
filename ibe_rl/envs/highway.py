"""The task of highway-env's road of three lanes: overtake, and keep to the right where the road is free.

An instruction has two numbers: to the left or to the right lane, and slower or faster. Lengths are metres. Lanes are
counted from the left: 0, 1, 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ibe_rl.types import Array

LANES, LANE_WIDTH = 3, 4.0
SEEN_AHEAD, BESIDE = 100.0, 10.0
"""How far the road is looked at, and up to where a vehicle behind counts as beside the car."""
CLEAR_ROAD, SAFE_GAP, BETTER_BY = 50.0, 20.0, 10.0
"""Free road that makes a lane worth driving in, that is needed to move there, and by which an unclear one is better."""
ROOM_AHEAD, TOO_CLOSE = 40.0, 30.0
"""Free road from which to drive faster, and below which to drive slower."""
FAST_MPS, SLOW_MPS = 28.0, 22.0
"""Above and below these speeds in m/s, the car need not become faster or slower."""
LEAST_OVERTAKEN = 3
"""Vehicles that an episode that succeeds leaves behind."""
CAR_LANE, CAR_SPEED, CARS_OVERTAKEN = 0, 1, 6
FREE_ROADS = slice(3, 6)


def traffic(env: Any, observation: Any) -> Array:
    """What the rule reads: the car's lane, its speed in m/s, the free road in each lane, the vehicles behind it.

    Returns:
        ``(7,)``: lane, speed, speed to the right, free road ahead on each lane, vehicles overtaken.
    """
    del observation
    car = env.vehicle
    others = np.array([other.position for other in env.road.vehicles if other is not car]).reshape(-1, 2) - car.position
    lane = car.position[1] / LANE_WIDTH
    ahead = [free_road(others, (number - lane) * LANE_WIDTH) for number in range(LANES)]
    return np.array([lane, car.speed, car.velocity[1], *ahead, (others[:, 0] < 0).sum()])


def free_road(others: Array, aside: float) -> float:
    """The free road in a lane.

    Args:
        others: ``(V, 2)`` places of other vehicles, ahead and to the right of the car.
        aside: how far to the right of the car the lane lies.
    """
    behind = BESIDE if abs(aside) > LANE_WIDTH / 2 else 0.0
    near = others[(np.abs(others[:, 1] - aside) < 0.6 * LANE_WIDTH) & (others[:, 0] > -behind), 0]
    return float(np.clip(near.min(initial=SEEN_AHEAD), 0.0, SEEN_AHEAD))


def driving_rule(states: Array) -> Array:
    """What a driver should do.

    Args:
        states: ``(..., 7)``.

    Returns:
        ``(..., 2)`` float32: -1 to the left lane, +1 to the right lane, and -1 slower, +1 faster; else 0.
    """
    lane = np.rint(states[..., CAR_LANE]).astype(int).clip(0, LANES - 1)
    ahead, speed = states[..., FREE_ROADS], states[..., CAR_SPEED]
    here = _at(ahead, lane)
    aside = np.sign(_wanted(ahead, here, lane) - lane)
    aside = np.where(_at(ahead, lane + aside) >= SAFE_GAP, aside, 0)
    faster = (here > ROOM_AHEAD) & (speed < FAST_MPS)
    slower = (here < TOO_CLOSE) & (speed > SLOW_MPS)
    return np.stack([aside, faster.astype(int) - slower], axis=-1).astype(np.float32)


def _wanted(ahead: Array, here: Array, lane: Array) -> Array:
    """The rightmost lane that is clear; if none is, the one with the most free road."""
    clear = ahead >= CLEAR_ROAD
    rightmost = LANES - 1 - clear[..., ::-1].argmax(axis=-1)
    better = np.where(ahead.max(axis=-1) > here + BETTER_BY, ahead.argmax(axis=-1), lane)
    return np.where(clear.any(axis=-1), rightmost, better)


def _at(values: Array, lane: Array) -> Array:
    found: Array = np.take_along_axis(values, lane[..., None], axis=-1)[..., 0]
    return found


def overtook(state: Array, terminated: bool, truncated: bool) -> bool:
    """Whether the time is over without a collision, with ``LEAST_OVERTAKEN`` vehicles behind."""
    return truncated and not terminated and bool(state[CARS_OVERTAKEN] >= LEAST_OVERTAKEN)
