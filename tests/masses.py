"""Points on a line that are told where to go, whose truth is obvious: what +1 asks for is known, and who obeys too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ibe_rl.types import Array, Episode

STEPS, BAND = 40, 0.5
Agent = Callable[[Array, float, np.random.Generator], float]
"""State ``(2,)``, place and speed, and instruction, to the acceleration."""
Rule = Callable[[Array, int, int], float]
"""State, step and episode, to the instruction."""


def obeys(_state: Array, instruction: float, chance: np.random.Generator) -> float:
    return instruction + chance.normal()


def opposes(_state: Array, instruction: float, chance: np.random.Generator) -> float:
    return -instruction + chance.normal()


def ignores(_state: Array, _instruction: float, chance: np.random.Generator) -> float:
    return float(chance.normal())


def to_the_middle(state: Array, _step: int, _episode: int) -> float:
    """+1 asks to the right: as long as the goal at 0 lies there, up to a dead band."""
    return float(-np.sign(state[0]) * (abs(state[0]) > BAND))


def speed_up(state: Array, _step: int, _episode: int) -> float:
    """+1 asks for more speed, as long as it is below 0."""
    return float(-np.sign(state[1]) * (abs(state[1]) > 0.1))


def planned(_state: Array, step: int, episode: int) -> float:
    """+1 asks to the right, for ten steps at a time, whatever the state is; another plan in each episode."""
    return float(np.random.default_rng((episode, step // 10)).integers(-1, 2))


def fly(
    agent: Agent = obeys,
    rule: Rule = to_the_middle,
    *,
    episodes: int = 40,
    steps: int = STEPS,
    pays: float = 0.0,
    per_step: float = 0.0,
    heard_every: int = 1,
    seed: int = 0,
) -> list[Episode]:
    """Episodes that begin anywhere.

    Args:
        agent: who decides.
        rule: who speaks.
        episodes: how many.
        steps: of each.
        pays: what a step earns for each unit of speed the way that was told.
        per_step: what every step earns.
        heard_every: of so many steps the instructor is heard at one, drawn by chance.
        seed: of all that is random.
    """
    return [_one(agent, rule, number, steps, pays, per_step, heard_every, seed) for number in range(episodes)]


def _one(
    agent: Agent, rule: Rule, number: int, steps: int, pays: float, per_step: float, heard_every: int, seed: int
) -> Episode:
    chance = np.random.default_rng((seed, number))
    state, last = np.array([chance.uniform(-3, 3), 0.0]), 0.0
    states, instruction, given, rewards = [state], [], [], []
    for step in range(steps):
        if chance.random() < 1 / heard_every:
            last = rule(state, step, number)
            given.append(True)
        else:
            given.append(False)
        speed = 0.7 * state[1] + 0.1 * agent(state, last, chance)
        state = np.array([state[0] + speed, speed])
        states.append(state)
        instruction.append(last * given[-1])
        rewards.append(per_step + pays * last * speed)
    return Episode(
        states=np.array(states),
        actions=np.zeros(steps, int),
        rewards=np.array(rewards),
        instructions=np.array(instruction)[:, None],
        given=np.array(given),
        terminated=False,
        success=False,
        context="here",
    )


def seen_as(episodes: Sequence[Episode], mixing: Array, shift: Array) -> list[Episode]:
    """The same in other coordinates ``(S, S')``."""
    return [replace(one, states=one.states @ mixing + shift) for one in episodes]
