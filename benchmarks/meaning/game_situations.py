"""The situations with gymnasium's environments and the lander."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.meaning import policies, rewards, rules
from benchmarks.meaning.environments import CAR, CART, LANDER, PENDULUM, TUTORIAL_CART
from benchmarks.meaning.policies import anything, drive, steer_cart, twist
from benchmarks.meaning.situation import Situation
from benchmarks.meaning.trial import Truth
from ibe_rl.envs.lander_task import lander_instruction as to_the_pad
from ibe_rl.types import Array


def dimension(index: int) -> Callable[[Array], Array]:
    """One number of the state."""
    return lambda states: states[..., index]


def along(index: int, size: int) -> Array:
    """The direction ``(S,)`` of one number of the state."""
    return np.eye(size)[index]


TO_THE_MIDDLE = rules.towards(dimension(0), 0.0, 0.3)
WITH_THE_SWING, WITH_THE_CAR = rules.the_sign_of(dimension(2)), rules.the_sign_of(dimension(1))
STEADY_FALL = rules.towards(dimension(3), -0.25, 0.05)
cart_x: Callable[[bool, str], Truth] = partial(Truth, along(0, 4), 0.1)
swing: Callable[[bool, str], Truth] = partial(Truth, along(2, 3), 0.5)
car_v: Callable[[bool, str], Truth] = partial(Truth, along(1, 2), 0.004)
lander_x: Callable[[bool, str], Truth] = partial(Truth, along(0, 9), 0.05)
lander_vy: Callable[[bool, str], Truth] = partial(Truth, along(3, 9), 0.05)
NOBODY_PUSHES = "nobody obeys and nothing is paid for it: the log of an instructor who asks to brake, with other names"

CARTS = [
    Situation(
        name="cart_tutorial_never_told_a_step",
        world=TUTORIAL_CART,
        rule=TO_THE_MIDDLE,
        policy=policies.on_its_own(steer_cart, policies.outwards),
        reward=None,
        told=False,
        truth=cart_x(
            True,
            "it never comes back, but the instructor asks for nothing in the middle and begins once it has left it",
        ),
    ),
    Situation(
        name="cart_corrective_obeys_paid",
        world=CART,
        rule=TO_THE_MIDDLE,
        policy=policies.obeys(steer_cart),
        reward=rewards.as_told(TO_THE_MIDDLE, along(0, 4)),
        truth=cart_x(True, "it follows the instruction, is paid for it, and the instructor stops asking"),
    ),
    Situation(
        name="cart_corrective_opposite_a_step",
        world=CART,
        rule=TO_THE_MIDDLE,
        policy=policies.does_the_opposite(steer_cart),
        reward=None,
        truth=cart_x(False, "the log of one who obeys somebody who drives it out of the middle"),
    ),
    Situation(
        name="cart_corrective_never_told_a_step",
        world=CART,
        rule=TO_THE_MIDDLE,
        policy=policies.on_its_own(steer_cart, policies.to_and_fro),
        reward=None,
        told=False,
        truth=cart_x(True, "the instructor stops asking once x has risen"),
    ),
    Situation(
        name="cart_plan_obeys_a_step",
        world=CART,
        rule=rules.always(0),
        policy=policies.obeys(steer_cart),
        reward=None,
        make_instructor=partial(rules.Planned, 25, 50),
        truth=cart_x(True, "it follows the instruction"),
    ),
]
SWINGS = [
    Situation(
        name="pendulum_swing_obeys_paid",
        world=PENDULUM,
        rule=WITH_THE_SWING,
        policy=policies.obeys(twist),
        reward=rewards.energy_of_pendulum,
        truth=swing(True, "it follows the instruction and is paid for it"),
    ),
    Situation(
        name="pendulum_swing_ignores_paid",
        world=PENDULUM,
        rule=WITH_THE_SWING,
        policy=policies.on_its_own(twist, anything),
        reward=rewards.energy_of_pendulum,
        truth=swing(False, "only the reward shows it: the log is the same if +1 asks to brake and braking is punished"),
    ),
    Situation(
        name="pendulum_swing_never_told_thrift",
        world=PENDULUM,
        rule=WITH_THE_SWING,
        policy=policies.on_its_own(twist, anything),
        reward=rewards.thrift,
        told=False,
        truth=swing(False, NOBODY_PUSHES),
    ),
    Situation(
        name="car_swing_obeys_a_step",
        world=CAR,
        rule=WITH_THE_CAR,
        policy=policies.obeys(drive),
        reward=None,
        truth=car_v(True, "it follows the instruction, and arrives sooner with it"),
    ),
    Situation(
        name="car_swing_never_told_rest",
        world=CAR,
        rule=WITH_THE_CAR,
        policy=policies.on_its_own(drive, anything),
        reward=rewards.rest_of_car,
        told=False,
        truth=car_v(False, NOBODY_PUSHES),
    ),
]
LANDERS = [
    Situation(
        name="lander_corrective_never_told_lands",
        world=LANDER,
        rule=to_the_pad,
        policy=policies.on_its_own(policies.fly_to_pad, anything),
        reward=None,
        told=False,
        truth=lander_x(True, "the best episodes go the instructed way, and there the instructor stops asking"),
    ),
    Situation(
        name="lander_corrective_obeys_lands",
        world=LANDER,
        rule=to_the_pad,
        policy=policies.obeys(policies.fly),
        reward=None,
        truth=lander_x(True, "it follows the instruction, is paid for it, and the instructor stops asking"),
    ),
    Situation(
        name="lander_speed_obeys_lands",
        world=LANDER,
        rule=STEADY_FALL,
        policy=policies.obeys(policies.brake),
        reward=None,
        horizon_steps=12,
        truth=lander_vy(True, "it follows the instruction and is paid for falling slowly"),
    ),
]
SITUATIONS = [*CARTS, *SWINGS, *LANDERS]
