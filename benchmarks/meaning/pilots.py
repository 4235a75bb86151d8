"""Who acts: for each world a hand-written controller that goes where it is asked to, and who asks it to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.meaning.mass import VX, X, unmixed
from ibe_rl.types import Array, Policy

Control = Callable[[Array, Array], Array]
"""States ``(N, S)`` and wishes ``(N,)``, +1 up, -1 down, 0 stay, to actions."""
Own = Callable[[Array], Array]
"""States ``(N, S)`` to wishes ``(N,)`` of one's own."""


# ---- who asks the controller


def obeys(control: Control) -> Policy:
    """Does what it is told."""
    return lambda seen: control(*_split(seen))


def does_the_opposite(control: Control) -> Policy:
    """Does the opposite of what it is told."""

    def policy(seen: Array) -> Array:
        states, told = _split(seen)
        return control(states, -told)

    return policy


def on_its_own(control: Control, own: Own) -> Policy:
    """Was never told, or ignores it: the instruction changes nothing."""

    def policy(seen: Array) -> Array:
        states, _ = _split(seen)
        return control(states, own(states))

    return policy


def begins(control: Control, share: float) -> Policy:
    """A beginner: obeys in a share of the states, without any pattern, and acts without any plan in the others."""

    def policy(seen: Array) -> Array:
        states, told = _split(seen)
        return control(states, np.where(_lot(states, 1) < share, told, 2 * _lot(states, 2) - 1))

    return policy


def by_lamp(lit: Policy, dark: Policy) -> Policy:
    """Is one agent in the episodes in which the lamp, the last number of the state, is on, and another in the rest."""
    return lambda seen: np.where(seen[:, [-3]] > 0, lit(seen), dark(seen))


def while_told(told: Policy, in_silence: Policy) -> Policy:
    """Is one agent while somebody speaks, and another in silence."""
    return lambda seen: np.where(seen[:, [-1]] > 0, told(seen), in_silence(seen))


def _split(seen: Array) -> tuple[Array, Array]:
    """Observations ``(N, S + 2)`` to states and instructions ``(N,)``."""
    return seen[:, :-2], seen[:, -2]


def _lot(states: Array, stream: int) -> Array:
    """A number in [0, 1) for each state that looks random: a policy may not draw, it has to be a function."""
    weights = np.sin(np.arange(1, states.shape[1] + 1) * (12.9898 + 7.233 * stream))
    found: Array = np.mod(np.sin(states.astype(float) @ weights * 971.3) * 43758.5453, 1.0)
    return found


# ---- what it wishes on its own


def anything(states: Array) -> Array:
    """Without any plan."""
    return 2 * _lot(states, 3) - 1


def outwards(states: Array) -> Array:
    """A cart away from the middle."""
    return 0.8 * np.sign(states[:, 0])


def sways(states: Array) -> Array:
    """A mass to and fro, by itself: the oscillator of van der Pol, about 2 to either side in 7 s."""
    x, vx = unmixed(states)[:, [X, VX]].T
    return np.clip(-x + 0.8 * vx * (1 - x**2 / 1.5), -1, 1)


def to_and_fro(states: Array) -> Array:
    """A cart to and fro between -1 and 1: on in the way it goes, back beyond."""
    x, vx = states[:, :2].T
    return np.where(np.abs(x) > 1, -np.sign(x), np.where(vx >= 0, 1.0, -1.0))


# ---- controllers


def steer_cart(states: Array, wish: Array) -> Array:
    """CartPole: balance, with a set-point on the side of the wish, within the rails."""
    x, vx, angle, turning = states.T
    pull = np.clip(x + wish, -1.9, 1.9) - x
    return (-0.8 * pull + 1.6 * vx + 18 * angle + 4 * turning > 0).astype(int)


def twist(states: Array, wish: Array) -> Array:
    """Pendulum: a small torque."""
    del states
    return (0.6 * wish)[:, None].astype(np.float32)


def drive(states: Array, wish: Array) -> Array:
    """MountainCar: the motor."""
    del states
    return np.rint(1 + wish).astype(int)


def go(states: Array, wish: Array) -> Array:
    """Point mass: along x at the speed of the wish, 0 stands; y as always."""
    _, vx, y, vy = unmixed(states).T
    return _pushes(2 * (0.8 * wish - vx), y, vy)


def push(states: Array, wish: Array) -> Array:
    """Point mass: accelerate along x by the wish; y as always."""
    _, _, y, vy = unmixed(states).T
    return _pushes(wish, y, vy)


def _pushes(along_x: Array, y: Array, vy: Array) -> Array:
    along_y = -y + 0.8 * vy * (1 - y**2)
    return np.clip(np.stack([along_x, along_y], axis=1), -1, 1).astype(np.float32)


def fly(states: Array, wish: Array) -> Array:
    """Lander: gymnasium's heuristic pilot, with a set-point on the side of the wish."""
    return _pilot(states, 0.5 * wish)


def fly_to_pad(states: Array, wish: Array) -> Array:
    """Lander: gymnasium's heuristic pilot, to the pad; the wish counts nothing."""
    del wish
    return _pilot(states, states[:, 8] - states[:, 0])


def brake(states: Array, wish: Array) -> Array:
    """Lander: more main engine for +1, none for -1, else a steady fall; steers to the pad as always."""
    actions = _pilot(states, states[:, 8] - states[:, 0])
    burn = (wish > 0) | ((wish == 0) & (states[:, 3] < -0.3))
    airborne = states[:, 6:8].sum(axis=1) == 0
    upright = np.abs(states[:, 4]) < 0.25
    steered = np.where(actions == 2, 0, actions)
    return np.where(airborne, np.where(burn & upright, 2, steered), actions)


def _pilot(states: Array, offset: Array) -> Array:
    """The pilot of gymnasium, with the goal ``offset`` ``(N,)`` to the right."""
    _, y, vx, vy, angle, turning, left, right, _ = states.T
    down = (left + right) > 0
    lean = np.clip(-0.5 * offset + vx, -0.4, 0.4)
    turn = np.where(down, 0, (lean - angle) * 0.5 - turning)
    lift = np.where(down, -vy * 0.5, (0.55 * np.abs(offset) - y) * 0.5 - vy * 0.5)
    lifts = (lift > np.abs(turn)) & (lift > 0.05)
    return np.where(lifts, 2, np.where(turn < -0.05, 3, np.where(turn > 0.05, 1, 0)))
