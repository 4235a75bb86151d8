"""The paper's agents, found among the policies that a run kept: A in the middle of learning, B better, C the last."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.data import Episode, Policy
from ibe_rl.metrics.bootstrap import Estimate
from ibe_rl.metrics.effect import share

PAPER_SUCCESS = {"A": 19 / 30, "B": 25 / 30}
"""Of the paper's agents: 63.3 % and 83.3 %."""
NEAR = 0.08
COARSE = 40
"""How many policies fly in the first round, evenly spaced."""
EPISODES = (30, 80, 200, 500)
STAYING = (4, 6, 3, 1)
"""How many episodes a policy has flown after each round, and how many policies then stay in the race for an agent."""

Fly = Callable[[Policy, Sequence[int]], list[Episode]]
"""Flies a whole greedy episode for each seed."""


@dataclass(frozen=True)
class Skilled:
    """One of the agents.

    Attributes:
        name: "A", "B" or "C".
        wanted: its success in the paper; None for C.
        frame: training frames when its policy was kept.
        policy: greedy.
        episodes: flown again, on seeds that it was not chosen by.
    """

    name: str
    wanted: float | None
    frame: int
    policy: Policy
    episodes: Sequence[Episode]

    @property
    def success(self) -> Estimate:
        """Of these episodes."""
        return share([episode.success for episode in self.episodes])

    @property
    def near(self) -> bool:
        """Whether it is as good as the paper's, up to 8 points; C always is."""
        return self.wanted is None or round(abs(self.success.value - self.wanted), 9) <= NEAR


def screen(
    policies: dict[int, Policy], fly: Fly, seeds: Sequence[int], step: Callable[[], None] = lambda: None
) -> tuple[dict[str, int], dict[int, list[bool]]]:
    """Find the policies whose success is nearest to that of the paper's agents.

    Some evenly spaced ones fly a few episodes, the nearest of them and all around these some more, and so on with
    fewer and fewer.

    Args:
        policies: training frames to policies, in rising order.
        fly: flies them.
        seeds: at least as many as the last round asks for. Each policy flies others, as far as there are enough: were
            they the same for all and a little harder than most, then all would be found less skilled than they are.
        step: called after each flight.

    Returns:
        Names of agents to frames, the earliest of equals; and for each policy which of its episodes succeeded.
    """
    frames = list(policies)
    stride = -(-len(frames) // COARSE)
    tried: dict[int, list[bool]] = {frame: [] for frame in frames}

    def race(entered: Sequence[int], number: int, wanted: float) -> list[int]:
        for frame in sorted(entered):
            first = frames.index(frame) * EPISODES[-1] % (len(seeds) - EPISODES[-1] + 1)
            more = seeds[first + len(tried[frame]) : first + EPISODES[number]]
            if more:
                tried[frame] += [episode.success for episode in fly(policies[frame], more)]
                step()
        nearest = sorted(sorted(entered), key=lambda frame: abs(float(np.mean(tried[frame])) - wanted))
        return nearest[: STAYING[number]]

    chosen = {}
    for name, wanted in PAPER_SUCCESS.items():
        near = race(frames[::stride], 0, wanted)
        left = [*{near_by for frame in near for near_by in _around(frames, frame, stride - 1)}]
        for number in range(1, len(EPISODES)):
            left = race(left, number, wanted)
        [chosen[name]] = left
    return chosen, {frame: flown for frame, flown in tried.items() if flown}


def _around(frames: Sequence[int], frame: int, reach: int) -> Sequence[int]:
    place = frames.index(frame)
    return frames[max(0, place - reach) : place + reach + 1]


def most_flights(policies: int) -> int:
    """How often ``screen`` calls ``fly`` at most."""
    stride = -(-policies // COARSE)
    return min(policies, COARSE) + len(PAPER_SUCCESS) * (2 * stride * STAYING[0] + sum(STAYING[1:]))
