"""Baselines that explanations have to beat: statements about the next steps without a vocabulary."""

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

from ibe_rl.evaluation.moments import Moments
from ibe_rl.ibe.delta import delta_states
from ibe_rl.metrics.quality import direction
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode, ExpressionMapping

MAX_REGRESSION_WINDOWS = 60_000
"""Most windows to fit the regressor on, drawn at random."""
CHEAP = ("present_velocity", "direction_to_goal", "last_instruction", "constant", "state_regressor")
"""Baselines that need no simulator."""


@dataclass(frozen=True)
class StateRegressor:
    """A regression from the state, which includes the goal, to the change of one explained dimension.

    Attributes:
        kind: "ridge" or "boosting", whichever predicted held-out episodes better.
        model: the fitted scikit-learn regressor.
        r2: of both kinds on the held-out episodes.
    """

    kind: str
    model: Any
    r2: dict[str, float]

    def predict(self, states: Array) -> Array:
        """States ``(N, S)`` to changes ``(N,)``."""
        return np.asarray(self.model.predict(states))


@dataclass(frozen=True)
class Learnt:
    """All that is learnt from the log for one horizon.

    Attributes:
        vocabularies: explainer to its vocabulary, the evaluated one first.
        ensembles: negative control to its many vocabularies, whose distribution is reported. If empty, the other
            negative controls are left out too.
        regressors: from the state alone to the change, one for each number of an instruction.
    """

    vocabularies: dict[str, ExpressionMapping]
    ensembles: dict[str, Sequence[ExpressionMapping]]
    regressors: Sequence[StateRegressor]


def fit_state_regressors(
    episodes: Sequence[Episode], horizon_steps: int, task: Task, seed: int
) -> list[StateRegressor]:
    """Fit one regressor for each number of an instruction, on windows of the log.

    Args:
        episodes: of the log, at least two, good and bad.
        horizon_steps: of the windows, which end with their episode at the latest.
        task: names the explained dimensions.
        seed: of the draws.
    """
    states = np.concatenate([episode.states[:-1] for episode in episodes])
    changes = np.concatenate([delta_states(episode.states, horizon_steps, "clamp") for episode in episodes])
    numbers = np.repeat(np.arange(len(episodes)), [len(episode) for episode in episodes])
    rows = np.random.default_rng(seed).permutation(len(states))[:MAX_REGRESSION_WINDOWS]
    return [_fit(states[rows], changes[rows, dimension], numbers[rows], seed) for dimension in task.explained]


def _fit(states: Array, change: Array, episode: Array, seed: int) -> StateRegressor:
    """Fit both kinds, select the better one on held-out episodes, and refit it on all."""
    kinds: dict[str, Any] = {
        "ridge": make_pipeline(StandardScaler(), Ridge()),
        "boosting": HistGradientBoostingRegressor(random_state=seed),
    }
    learnt, left = next(GroupShuffleSplit(1, random_state=seed).split(states, groups=episode))
    r2 = {
        kind: model.fit(states[learnt], change[learnt]).score(states[left], change[left])
        for kind, model in kinds.items()
    }
    best = max(r2, key=lambda kind: r2[kind])
    return StateRegressor(best, kinds[best].fit(states, change), {kind: float(value) for kind, value in r2.items()})


def forecasts(regressors: Sequence[StateRegressor], states: Array) -> Array:
    """States ``(N, S)`` to the changes ``(N, d)`` predicted by the regressors of the ``d`` numbers."""
    return np.stack([one.predict(states) for one in regressors], axis=1)


def cheap_baselines(
    moments: Moments,
    horizon_steps: int,
    task: Task,
    regressors: Sequence[StateRegressor],
    instruction: Array | None = None,
) -> dict[str, Array]:
    """Statements ``(N, d)`` of each baseline without a simulator; those that the task does not support are missing.

    ``instruction`` ``(N, d)`` is the last one, of words the directions that they ask for; None: that of the moments.
    """
    instruction = moments.instruction if instruction is None else instruction
    states = moments.state
    said = {
        "last_instruction": instruction,
        "constant": np.zeros(instruction.shape),
        "state_regressor": forecasts(regressors, states),
    }
    if task.motion is not None:
        said["present_velocity"] = horizon_steps * task.motion(states)
    if task.goal_offset is not None:
        said["direction_to_goal"] = task.goal_offset(states)
    return {name: np.asarray(said[name], float) for name in CHEAP if name in said}


def as_instruction(name: str, said: Array, band: Sequence[float]) -> Array:
    """Statements of a baseline ``(N, d)`` on the instructor's scale: changes become their direction."""
    return said if name in ("last_instruction", "constant") else direction(said, np.array(band)).astype(float)
