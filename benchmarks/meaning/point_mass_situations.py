"""The situations with a point mass whose state is observed as a linear mixture."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.meaning import policies, rewards, rules
from benchmarks.meaning.environments import MASS
from benchmarks.meaning.point_mass import UNMIXED, VX, X, unmixed
from benchmarks.meaning.policies import anything, go, push, sways
from benchmarks.meaning.situation import Situation
from benchmarks.meaning.trial import Truth
from ibe_rl.types import Array


def place(states: Array) -> Array:
    """Place along x of states ``(..., S)``."""
    return unmixed(states)[..., X]


def speed(states: Array) -> Array:
    """Speed along x of states ``(..., S)``."""
    return unmixed(states)[..., VX]


def controller(states: Array) -> Array:
    """What a controller that brings the mass to rest at 0 would push."""
    return -place(states) - 1.2 * speed(states)


TO_THE_GOAL = rules.towards(place, 0.5, 0.3)
AT_THE_SPEED = rules.towards(speed, 0.6, 0.15)
BY_CONTROLLER = rules.the_sign_of(controller)
LEFT_OF_GOAL = rules.only_below(place, 0.5)
RISES_X, RISES_VX = UNMIXED[X], UNMIXED[VX]
to_x: Callable[[bool, str], Truth] = partial(Truth, RISES_X, 0.2)
to_vx: Callable[[bool, str], Truth] = partial(Truth, RISES_VX, 0.1)
RISES_BOTH = RISES_X + 1.2 * RISES_VX  # what a push raises, and by the minus of which the controller goes
to_both: Callable[[bool, str], Truth] = partial(Truth, RISES_BOTH, 0.15)
PLAN = partial(rules.Planned, 10, 25)
STOPS = "the instructor stops asking once x has risen, and there is a place at which it asks for nothing"
corrective = partial(Situation, world=MASS, rule=TO_THE_GOAL)
by_speed = partial(Situation, world=MASS, rule=AT_THE_SPEED, horizon_steps=8)
by_action = partial(Situation, world=MASS, rule=BY_CONTROLLER, horizon_steps=5)
planned = partial(Situation, world=MASS, rule=rules.always(0), make_instructor=PLAN, horizon_steps=12)
on_own = policies.on_its_own(push, sways)


def drifts_left(control: policies.Control) -> policies.Policy:
    """Obeys +1, and goes left at 0."""
    return policies.obeys(lambda states, wish: control(states, np.where(wish == 0, -0.6, wish)))


CORRECTIVE = [
    corrective(
        name="mass_corrective_obeys_paid",
        policy=policies.obeys(go),
        reward=rewards.as_told(TO_THE_GOAL, RISES_X),
        truth=to_x(True, "it follows the instruction, is paid for it, and the instructor stops asking"),
    ),
    corrective(
        name="mass_corrective_obeys_thrift",
        policy=policies.obeys(go),
        reward=rewards.thrift,
        truth=to_x(True, "it follows the instruction, and the instructor stops asking"),
    ),
    corrective(
        name="mass_corrective_ignores_by_lot",
        policy=on_own,
        reward=rewards.by_lot,
        truth=to_x(True, STOPS),
    ),
    corrective(
        name="mass_corrective_never_told_a_step",
        policy=on_own,
        reward=rewards.a_step,
        told=False,
        truth=to_x(True, STOPS),
    ),
    corrective(
        name="mass_corrective_never_told_rest",
        policy=on_own,
        reward=rewards.rest_of_mass,
        told=False,
        truth=to_x(True, STOPS),
    ),
    corrective(
        name="mass_corrective_never_told_paid",
        policy=on_own,
        reward=rewards.as_told(TO_THE_GOAL, RISES_X),
        told=False,
        truth=to_x(True, "following is paid, and " + STOPS),
    ),
    corrective(
        name="mass_corrective_random_thrift",
        policy=policies.on_its_own(push, lambda states: 1.5 * anything(states)),
        reward=rewards.thrift,
        told=False,
        truth=to_x(True, STOPS),
    ),
    corrective(
        name="mass_corrective_beginner_paid",
        policy=policies.begins(go, 0.2),
        reward=rewards.as_told(TO_THE_GOAL, RISES_X),
        truth=to_x(True, "it obeys a little, is paid for it, and the instructor stops asking"),
    ),
    corrective(
        name="mass_corrective_opposite_paid_opposite",
        policy=policies.does_the_opposite(go),
        reward=rewards.as_told(TO_THE_GOAL, RISES_X, -1),
        truth=to_x(
            False, "the log of one who obeys, and is paid for obeying, somebody who drives it away from the goal"
        ),
    ),
    corrective(
        name="mass_corrective_half_follows_paid_opposite",
        policy=policies.by_lamp(policies.obeys(go), on_own),
        reward=rewards.as_told(TO_THE_GOAL, RISES_X, -1),
        lamp=True,
        truth=Truth(
            np.append(RISES_X, 0),
            0.2,
            True,
            "in every second episode it goes up when instructed +1, and the instructor stops asking; the reward alone "
            "contradicts",
        ),
    ),
]
OTHERS = [
    by_speed(
        name="mass_speed_obeys_paid",
        policy=policies.obeys(push),
        reward=rewards.as_told(AT_THE_SPEED, RISES_VX),
        truth=to_vx(True, "it follows the instruction and is paid for it"),
    ),
    by_speed(
        name="mass_speed_never_told_thrift",
        policy=on_own,
        reward=rewards.thrift,
        told=False,
        truth=to_vx(False, "of a speed somebody may ask for less extremes or, as with a swing, for more: the same log"),
    ),
    by_action(
        name="mass_action_obeys_paid",
        policy=policies.obeys(push),
        reward=rewards.as_told(BY_CONTROLLER, RISES_BOTH),
        truth=to_both(True, "it follows the instruction and is paid for it"),
    ),
    by_action(
        name="mass_action_ignores_a_step",
        policy=on_own,
        reward=rewards.a_step,
        truth=to_both(False, "nobody obeys, nothing is paid for it, and no state is one in which nothing is asked for"),
    ),
    planned(
        name="mass_plan_obeys_a_step",
        policy=policies.obeys(go),
        reward=rewards.a_step,
        truth=to_x(True, "it follows the instruction"),
    ),
    planned(
        name="mass_plan_ignores_thrift",
        policy=on_own,
        reward=rewards.thrift,
        truth=to_x(False, "what is said has nothing to do with what happens"),
    ),
    corrective(
        name="mass_rare_obeys_rest",
        policy=policies.while_told(policies.obeys(go), on_own),
        reward=rewards.rest_of_mass,
        make_instructor=partial(rules.Rarely, TO_THE_GOAL, 0.05, 6),
        horizon_steps=10,
        truth=to_x(True, "in the few spells it follows the instruction"),
    ),
    Situation(
        name="mass_always_up_never_told_a_step",
        world=MASS,
        rule=rules.always(1),
        policy=on_own,
        reward=rewards.a_step,
        told=False,
        truth=to_x(False, "the same is said whatever happens"),
    ),
    Situation(
        name="mass_only_zero_ignores_by_lot",
        world=MASS,
        rule=rules.always(0),
        policy=on_own,
        reward=rewards.by_lot,
        truth=to_x(False, "the word is never used"),
    ),
    Situation(
        name="mass_one_sided_obeys_by_lot",
        world=MASS,
        rule=LEFT_OF_GOAL,
        policy=drifts_left(go),
        reward=rewards.by_lot,
        truth=to_x(True, "at +1 it goes up, else not, and at the goal the instructor stops asking"),
    ),
    Situation(
        name="mass_one_sided_never_told_rest",
        world=MASS,
        rule=LEFT_OF_GOAL,
        policy=on_own,
        reward=rewards.rest_of_mass,
        told=False,
        truth=to_x(True, STOPS),
    ),
]
SITUATIONS = [*CORRECTIVE, *OTHERS]
