"""The paper's agents, found among the policies that a run kept: A in the middle of learning, B better, C the last."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ibe_rl.metrics.bootstrap import Estimate
from ibe_rl.metrics.effect import share
from ibe_rl.types import Episode, Policy

PAPER_SUCCESS = {"A": 19 / 30, "B": 25 / 30}
"""Of the paper's agents: 63.3 % and 83.3 %."""
NEAR_SUCCESS = 0.08
COARSE = 40
"""How many policies run in the first round, evenly spaced."""
ROUND_EPISODES = (20, 60, 80, 200, 500)
STAYING = (14, 3, 5, 3, 1)
"""How many episodes a policy has run after each round, and how many policies then stay in the race for an agent."""
WIDENED = 2
"""Before this round all policies around those that are left join."""

RunAll = Callable[[Sequence[Policy], Sequence[Sequence[int]]], Iterable[list[Episode]]]
"""Runs a whole greedy episode for each seed of each policy; it may use other processes."""


@dataclass(frozen=True)
class PaperAgent:
    """One of the agents.

    Attributes:
        name: "A", "B" or "C".
        wanted: its success in the paper; None for C.
        frame: training frames when its policy was kept.
        policy: greedy.
        episodes: run again, on seeds that it was not chosen by.
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
        return self.wanted is None or round(abs(self.success.value - self.wanted), 9) <= NEAR_SUCCESS


def screen(
    policies: dict[int, Policy], run_all: RunAll, seeds: Sequence[int], step: Callable[[], None] = lambda: None
) -> tuple[dict[str, int], dict[int, list[bool]]]:
    """Find the policies whose success is nearest to that of the paper's agents.

    Some evenly spaced ones run a few episodes, the nearest of them and all around these some more, and so on with
    fewer and fewer.

    Args:
        policies: training frames to policies, in rising order.
        run_all: runs their episodes.
        seeds: at least as many as the last round asks for. Each policy has others, as far as there are enough: seeds
            that are harder than most would make every policy look less skilled than it is.
        step: called after each policy of each round.

    Returns:
        Names of agents to frames, the earliest of equals; and for each policy which of its episodes succeeded.
    """
    race = _Race(policies, run_all, seeds, step)
    frames, stride, chosen = list(policies), _stride(len(policies)), {}
    for name, wanted in PAPER_SUCCESS.items():
        left = frames[::stride]
        for number in range(len(ROUND_EPISODES)):
            if number == WIDENED:
                left = [*{near_by for frame in left for near_by in _around(frames, frame, stride - 1)}]
            left = race.run(left, number, wanted)
        [chosen[name]] = left
    return chosen, {frame: successes for frame, successes in race.tried.items() if successes}


class _Race:
    """Which episodes of each policy have succeeded so far; the arguments are those of ``screen``."""

    def __init__(
        self, policies: dict[int, Policy], run_all: RunAll, seeds: Sequence[int], step: Callable[[], None]
    ) -> None:
        self._policies, self._run_all, self._seeds, self._step = policies, run_all, seeds, step
        spare = len(seeds) - ROUND_EPISODES[-1] + 1
        self._first = {frame: place * ROUND_EPISODES[-1] % spare for place, frame in enumerate(policies)}
        self.tried: dict[int, list[bool]] = {frame: [] for frame in policies}

    def run(self, entered: Sequence[int], number: int, wanted: float) -> list[int]:
        """Run what is due in a round; returns the policies that stay, the nearest first."""
        due = [frame for frame in sorted(entered) if len(self.tried[frame]) < ROUND_EPISODES[number]]
        seeds = [self._more(frame, ROUND_EPISODES[number]) for frame in due]
        results = self._run_all([self._policies[frame] for frame in due], seeds)
        for frame, episodes in zip(due, results, strict=True):
            self.tried[frame] += [episode.success for episode in episodes]
            self._step()
        nearest = sorted(sorted(entered), key=lambda frame: abs(float(np.mean(self.tried[frame])) - wanted))
        return nearest[: STAYING[number]]

    def _more(self, frame: int, episodes: int) -> Sequence[int]:
        """The seeds that a policy has not had yet."""
        first = self._first[frame]
        return self._seeds[first + len(self.tried[frame]) : first + episodes]


def _stride(policies: int) -> int:
    return -(-policies // COARSE)


def _around(frames: Sequence[int], frame: int, reach: int) -> Sequence[int]:
    place = frames.index(frame)
    return frames[max(0, place - reach) : place + reach + 1]


def most_runs(policies: int) -> int:
    """How often ``screen`` runs a policy at most."""
    around = 2 * _stride(policies) * STAYING[WIDENED - 1]
    return min(policies, COARSE) + len(PAPER_SUCCESS) * (around + sum(STAYING))
