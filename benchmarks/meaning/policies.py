"""Policies: a hand-written controller for each environment, and what decides where it goes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.meaning.point_mass import VX, X, unmixed
from ibe_rl.types import Array, Policy

Control = Callable[[Array, Array], Array]
"""States ``(N, S)`` and targets ``(N,)``, +1 up, -1 down, 0 stay, to actions."""
Own = Callable[[Array], Array]
"""States ``(N, S)`` to targets ``(N,)``, without an instruction."""


# ---- policies


def obeys(control: Control) -> Policy:
    """Follows the instruction."""
    return lambda seen: control(*_split(seen))


def does_the_opposite(control: Control) -> Policy:
    """Follows the opposite of the instruction."""

    def policy(seen: Array) -> Array:
        states, told = _split(seen)
        return control(states, -told)

    return policy


def on_its_own(control: Control, own: Own) -> Policy:
    """Ignores the instruction."""

    def policy(seen: Array) -> Array:
        states, _ = _split(seen)
        return control(states, own(states))

    return policy


def begins(control: Control, share: float) -> Policy:
    """Follows the instruction in a random share of the states, and has random targets in the others."""

    def policy(seen: Array) -> Array:
        states, told = _split(seen)
        return control(states, np.where(_lot(states, 1) < share, told, 2 * _lot(states, 2) - 1))

    return policy


def by_lamp(lit: Policy, dark: Policy) -> Policy:
    """One policy in the episodes with the lamp (last number of the state) on, another in the rest."""
    return lambda seen: np.where(seen[:, [-3]] > 0, lit(seen), dark(seen))


def while_told(told: Policy, in_silence: Policy) -> Policy:
    """One policy under an instruction, another in silence."""
    return lambda seen: np.where(seen[:, [-1]] > 0, told(seen), in_silence(seen))


def _split(seen: Array) -> tuple[Array, Array]:
    """Observations ``(N, S + 2)`` to states and instructions ``(N,)``."""
    return seen[:, :-2], seen[:, -2]


def _lot(states: Array, stream: int) -> Array:
    """A pseudo-random number in [0, 1) for each state, since a policy has to be a function."""
    weights = np.sin(np.arange(1, states.shape[1] + 1) * (12.9898 + 7.233 * stream))
    found: Array = np.mod(np.sin(states.astype(float) @ weights * 971.3) * 43758.5453, 1.0)
    return found


# ---- targets without an instruction


def anything(states: Array) -> Array:
    """Random targets."""
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


def steer_cart(states: Array, target: Array) -> Array:
    """CartPole: balance, with a set-point on the side of the target, within the track."""
    x, vx, angle, turning = states.T
    pull = np.clip(x + target, -1.9, 1.9) - x
    return (-0.8 * pull + 1.6 * vx + 18 * angle + 4 * turning > 0).astype(int)


def twist(states: Array, target: Array) -> Array:
    """Pendulum: a small torque."""
    del states
    return (0.6 * target)[:, None].astype(np.float32)


def drive(states: Array, target: Array) -> Array:
    """MountainCar: the motor."""
    del states
    return np.rint(1 + target).astype(int)


def go(states: Array, target: Array) -> Array:
    """Point mass: the target is the speed along x; y oscillates."""
    _, vx, y, vy = unmixed(states).T
    return _pushes(2 * (0.8 * target - vx), y, vy)


def push(states: Array, target: Array) -> Array:
    """Point mass: the target is the acceleration along x; y oscillates."""
    _, _, y, vy = unmixed(states).T
    return _pushes(target, y, vy)


def _pushes(along_x: Array, y: Array, vy: Array) -> Array:
    along_y = -y + 0.8 * vy * (1 - y**2)
    return np.clip(np.stack([along_x, along_y], axis=1), -1, 1).astype(np.float32)


def fly(states: Array, target: Array) -> Array:
    """Lander: gymnasium's heuristic pilot, with a set-point on the side of the target."""
    return _pilot(states, 0.5 * target)


def fly_to_pad(states: Array, target: Array) -> Array:
    """Lander: gymnasium's heuristic pilot, to the pad, whatever the target."""
    del target
    return _pilot(states, states[:, 8] - states[:, 0])


def brake(states: Array, target: Array) -> Array:
    """Lander: more main engine for +1, none for -1, else a steady fall; steers to the pad as always."""
    actions = _pilot(states, states[:, 8] - states[:, 0])
    burn = (target > 0) | ((target == 0) & (states[:, 3] < -0.3))
    airborne = states[:, 6:8].sum(axis=1) == 0
    upright = np.abs(states[:, 4]) < 0.25
    steered = np.where(actions == 2, 0, actions)
    return np.where(airborne, np.where(burn & upright, 2, steered), actions)


def _pilot(states: Array, offset: Array) -> Array:
    """Gymnasium's heuristic pilot, with the goal ``offset`` ``(N,)`` to the right."""
    _, y, vx, vy, angle, turning, left, right, _ = states.T
    down = (left + right) > 0
    lean = np.clip(-0.5 * offset + vx, -0.4, 0.4)
    turn = np.where(down, 0, (lean - angle) * 0.5 - turning)
    lift = np.where(down, -vy * 0.5, (0.55 * np.abs(offset) - y) * 0.5 - vy * 0.5)
    lifts = (lift > np.abs(turn)) & (lift > 0.05)
    return np.where(lifts, 2, np.where(turn < -0.05, 3, np.where(turn > 0.05, 1, 0)))
