"""gymnasium's step of the Lunar Lander without its overhead: the same physics calls, the same numbers.

Only without wind and rendering; leaves out checks, decorations and conversions to numpy. Names and constants are those
of ``gymnasium.envs.box2d.lunar_lander``. Tests check that both steps are equal bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from gymnasium.envs.box2d import lunar_lander as game

_SCALE = game.SCALE
HALF_WIDTH, HALF_HEIGHT = game.VIEWPORT_W / _SCALE / 2, game.VIEWPORT_H / _SCALE / 2
LEGS_BELOW = game.LEG_DOWN / _SCALE
ENGINES = ((0.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0))
"""Power of the main engine, and of the side engines to the right, for each discrete action."""


def lean_step(lunar: Any, action: Any) -> tuple[list[float], float, bool]:
    """Step a ``LunarLander``.

    Args:
        lunar: the environment; its bodies, ``prev_shaping`` and random generator are updated.
        action: 0 nothing, 1 left engine, 2 main engine, 3 right engine; or two continuous throttles.

    Returns:
        gymnasium's eight state numbers, its reward, and whether the episode terminated.
    """
    main, side = throttles(action) if lunar.continuous else ENGINES[action]
    _fire(lunar, main, side)
    lunar.world.Step(1.0 / game.FPS, 6 * 30, 2 * 30)
    state = _state(lunar)
    reward = _shaped(lunar, state) - main * 0.30 - abs(side) * 0.03
    if not lunar.lander.awake:
        return state, 100.0, True
    if lunar.game_over or abs(state[0]) >= 1.0:
        return state, -100.0, True
    return state, reward, False


def throttles(action: Sequence[float]) -> tuple[float, float]:
    """Continuous action to the power of main and side engines: 0, or between half and full."""
    main, side = min(max(float(action[0]), -1.0), 1.0), min(max(float(action[1]), -1.0), 1.0)
    return (main + 1.0) * 0.5 if main > 0 else 0.0, side if abs(side) > 0.5 else 0.0


def _fire(lunar: Any, main: float, side: float) -> None:
    """Apply the engines' impulses; always draws two random numbers."""
    draw, body = lunar.np_random.random, lunar.lander
    first, second = (-1.0 + 2.0 * draw()) / _SCALE, (-1.0 + 2.0 * draw()) / _SCALE  # as uniform(-1, 1) computes them
    if not (main or side):
        return
    angle, position = body.angle, body.position  # reading x and y costs half of unpacking
    tip_x, tip_y = math.sin(angle), math.cos(angle)
    side_x, side_y = -tip_y, tip_x
    x, y = position.x, position.y
    if main:
        along = game.MAIN_ENGINE_Y_LOCATION / _SCALE + 2 * first
        push_x, push_y = tip_x * along + side_x * second, -tip_y * along - side_y * second
        _push(body, (push_x, push_y), game.MAIN_ENGINE_POWER, main, (x + push_x, y + push_y))
    if side:
        across = 3 * second + math.copysign(1.0, side) * game.SIDE_ENGINE_AWAY / _SCALE
        push_x, push_y = tip_x * first + side_x * across, -tip_y * first - side_y * across
        point = (x + push_x - tip_x * 17 / _SCALE, y + push_y + tip_y * game.SIDE_ENGINE_HEIGHT / _SCALE)
        _push(body, (push_x, push_y), game.SIDE_ENGINE_POWER, abs(side), point)


def _push(body: Any, push: tuple[float, float], engine: float, power: float, point: tuple[float, float]) -> None:
    body.ApplyLinearImpulse((-push[0] * engine * power, -push[1] * engine * power), point, True)


def _state(lunar: Any) -> list[float]:
    body = lunar.lander
    position, velocity, legs = body.position, body.linearVelocity, lunar.legs
    return [
        (position.x - HALF_WIDTH) / HALF_WIDTH,
        (position.y - (lunar.helipad_y + LEGS_BELOW)) / HALF_HEIGHT,
        velocity.x * HALF_WIDTH / game.FPS,
        velocity.y * HALF_HEIGHT / game.FPS,
        body.angle,
        20.0 * body.angularVelocity / game.FPS,
        1.0 if legs[0].ground_contact else 0.0,
        1.0 if legs[1].ground_contact else 0.0,
    ]


def _shaped(lunar: Any, state: list[float]) -> float:
    """The change of gymnasium's potential since the last step; 0 at the first."""
    x, y, speed_x, speed_y, angle, _, left, right = state
    shaping = (
        -100 * math.sqrt(x * x + y * y)
        - 100 * math.sqrt(speed_x * speed_x + speed_y * speed_y)
        - 100 * abs(angle)
        + 10 * left
        + 10 * right
    )
    before, lunar.prev_shaping = lunar.prev_shaping, shaping
    return 0.0 if before is None else shaping - before
