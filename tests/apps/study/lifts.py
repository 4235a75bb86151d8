"""Rides of the lift of tests/by_hand.py, whose whole state is how high it is, and an agent that speaks about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from by_hand import TASK, on_a_line

from ibe_rl.apps.study.arms import Speaker
from ibe_rl.task import RecordedRollout, Shape, Task
from ibe_rl.types import Episode, Moment, Prediction

LIFT: Task = replace(TASK, state_names=("height",), state_units=("m",), explained_range=(20.0,))
DRAWN: Task = replace(LIFT, scene_path=lambda states: np.repeat(states, 2, axis=-1), scene_size=(20.0, 10.0))
HORIZON = 4
OURS, PAPERS = on_a_line([-4, 0, 4]), on_a_line([-4, 0, 4], [-0.4, 0.2, 1.0])
"""A change of 4 m in the next 4 steps is +1 in ours; the paper's leans upwards."""


def ride(heights: Sequence[float], terminated: bool = True) -> RecordedRollout:
    """An episode through these heights, without figures."""
    steps = len(heights) - 1
    episode = Episode(
        states=np.array(heights, float)[:, None],
        actions=np.zeros(steps, int),
        rewards=np.ones(steps),
        instructions=np.zeros((steps, 1)),
        given=np.ones(steps, bool),
        terminated=terminated,
        success=terminated,
        context="lower",
    )
    moments = [Moment(state, np.zeros(1), True) for state in episode.states[:-1]]
    return RecordedRollout(episode, moments, [], [[] for _ in heights])


def with_figures(watched: RecordedRollout) -> RecordedRollout:
    """The same, drawn by the environment."""
    figures = [[Shape(np.array([[height, 1.0]]), (1, 2, 3), closed=True)] for [height] in watched.episode.states]
    return replace(watched, background=[Shape(np.zeros((2, 2)), (9, 9, 9))], figures=figures)


class Climbs:
    """Foresees a metre a step upwards, but is not to be trusted above 30 m."""

    def rollout(self, moments: Sequence[Moment], policy: Any, horizon_steps: int) -> Prediction:
        now = np.array([moment.state for moment in moments], float)
        paths = now[:, None] + np.arange(horizon_steps + 1.0)[None, :, None]
        trusted = np.where(now[:, 0] > 30, 0, horizon_steps)
        return Prediction(paths, trusted, np.zeros(len(moments)))


def speaker(paper: Any = PAPERS, task: Task = LIFT) -> Speaker:
    """Says what it foresees, in three futures."""
    run: Any = SimpleNamespace(task=task, mapping=OURS, horizon_steps=HORIZON, policy=None, calibration=None)
    return Speaker(run, Climbs(), paper, futures=3, min_confidence=0.5)
