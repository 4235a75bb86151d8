"""Two agents, or two states of one, on the same seeds: what each does and says, and the difference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ibe_rl.apps.summary.episode_in_words import PlayedEpisode
from ibe_rl.apps.summary.steps import StepTable
from ibe_rl.evaluation.rows import estimate_json
from ibe_rl.metrics.bootstrap import weighted_mean
from ibe_rl.types import Array

OF_STEPS = {"came_true": "true", "not_as_told": "against", "said_not_as_told": "said_against"}
"""Measures that are shares of steps, and their columns."""
RolledAgent = tuple[Sequence[PlayedEpisode], StepTable]
"""The episodes of one agent, and their steps."""


def beside(ours: RolledAgent, theirs: RolledAgent, judges_success: bool) -> dict[str, Any]:
    """Measures and shares of phrases of two agents, aligned by name and text, with paired intervals.

    Both are resampled alike, since their episodes begin alike: the weights of ``ours`` are those of ``theirs``.

    Returns:
        ``measures`` and ``phrases``: rows of ``name``, ``this``, ``other`` and ``difference``, this minus other.
    """
    measures: dict[str, Callable[[RolledAgent], Array]] = {"success": _success} if judges_success else {}
    measures |= {"return": _return, "length_steps": _length}
    measures |= {name: _of_steps(column) for name, column in OF_STEPS.items()}
    said = {phrase: None for _, steps in (ours, theirs) for phrase in np.unique(steps.said.astype(str)).tolist()}
    rows = [_row(phrase, _said(phrase), ours, theirs) for phrase in said]
    rows.sort(key=lambda row: -(row["this"]["value"] + row["other"]["value"]))
    return {"measures": [_row(name, of, ours, theirs) for name, of in measures.items()], "phrases": rows}


def _row(name: str, of: Callable[[RolledAgent], Array], ours: RolledAgent, theirs: RolledAgent) -> dict[str, Any]:
    this, other = of(ours), of(theirs)
    return {
        "name": name,
        "this": estimate_json(this),
        "other": estimate_json(other),
        "difference": estimate_json(this - other),
    }


def _success(rolled: RolledAgent) -> Array:
    return weighted_mean(np.array([one.episode.success for one in rolled[0]]), rolled[1].weights)


def _return(rolled: RolledAgent) -> Array:
    return weighted_mean(np.array([one.episode.total_reward for one in rolled[0]]), rolled[1].weights)


def _length(rolled: RolledAgent) -> Array:
    return weighted_mean(np.array([len(one) for one in rolled[0]]), rolled[1].weights)


def _of_steps(column: str) -> Callable[[RolledAgent], Array]:
    return lambda rolled: rolled[1].share_samples(getattr(rolled[1], column), rolled[1].everywhere())


def _said(phrase: str) -> Callable[[RolledAgent], Array]:
    def share(rolled: RolledAgent) -> Array:
        steps = rolled[1]
        return steps.share_samples((steps.said == phrase).astype(float), steps.everywhere())

    return share
