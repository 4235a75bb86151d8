"""What can be said about the next steps without any vocabulary: the baselines that explanations have to beat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge
from sklearn.model_selection import GroupShuffleSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from ibe_rl.data import Array, Episode
from ibe_rl.evaluation.moments import Moments
from ibe_rl.ibe import delta_states
from ibe_rl.metrics.bootstrap import went
from ibe_rl.task import Task

MAX_WINDOWS = 60_000
"""The regressor learns from at most so many windows, drawn at random."""
CHEAP = ("present_velocity", "direction_to_goal", "last_instruction", "constant", "state_regressor")
"""Baselines that need no simulator."""


@dataclass(frozen=True)
class StateRegressor:
    """A regression from the state, the goal in it, to the change of the explained dimension.

    Attributes:
        kind: "ridge" or "boosting", whichever foretold left-out episodes better.
        model: the fitted scikit-learn regressor.
        r2: of both kinds on the left-out episodes.
    """

    kind: str
    model: Any
    r2: dict[str, float]

    def predict(self, states: Array) -> Array:
        """States ``(N, S)`` to changes ``(N,)``."""
        return np.asarray(self.model.predict(states))


def fit_state_regressor(episodes: Sequence[Episode], horizon_steps: int, task: Task, seed: int) -> StateRegressor:
    """Fit both kinds on the log's windows, keep the better one, and fit it again on all of them.

    Args:
        episodes: of the log, at least two, good ones and bad ones.
        horizon_steps: how far ahead; windows end with their episode.
        task: says which dimension is explained.
        seed: of the draws.
    """
    states = np.concatenate([episode.states[:-1] for episode in episodes])
    changes = np.concatenate([delta_states(episode.states, horizon_steps, "clamp") for episode in episodes])
    numbers = np.repeat(np.arange(len(episodes)), [len(episode) for episode in episodes])
    rows = np.random.default_rng(seed).permutation(len(states))[:MAX_WINDOWS]
    states, change, numbers = states[rows], changes[rows, task.explained], numbers[rows]
    kinds: dict[str, Any] = {
        "ridge": make_pipeline(StandardScaler(), Ridge()),
        "boosting": HistGradientBoostingRegressor(random_state=seed),
    }
    learnt, left = next(GroupShuffleSplit(1, random_state=seed).split(states, groups=numbers))
    r2 = {
        kind: model.fit(states[learnt], change[learnt]).score(states[left], change[left])
        for kind, model in kinds.items()
    }
    best = max(r2, key=lambda kind: r2[kind])
    return StateRegressor(best, kinds[best].fit(states, change), {kind: float(value) for kind, value in r2.items()})


def cheap_baselines(moments: Moments, horizon_steps: int, task: Task, regressor: StateRegressor) -> dict[str, Array]:
    """What each baseline without a simulator says ``(N,)``; those that the task declares nothing for are missing."""
    states = moments.state
    said = {
        "last_instruction": moments.instruction[:, 0],
        "constant": np.zeros(len(moments)),
        "state_regressor": regressor.predict(states),
    }
    if task.motion is not None:
        said["present_velocity"] = horizon_steps * task.motion(states)
    if task.goal_offset is not None:
        said["direction_to_goal"] = task.goal_offset(states)
    return {name: np.asarray(said[name], float) for name in CHEAP if name in said}


def as_instruction(name: str, said: Array, band: float) -> Array:
    """What a baseline says, on the instructor's scale: changes become the way that they go."""
    return said if name in ("last_instruction", "constant") else went(said, band).astype(float)
