"""The expressions of the clusters, and when a small movement is called straight: the paper's failed episode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ibe_rl.apps.paper.names import DEFAULT, PAPERS, SIGNS_KEPT, SPLIT_MINMAX
from ibe_rl.config.settings import MappingConfig
from ibe_rl.ibe.delta import cut_windows, top_episodes
from ibe_rl.ibe.mapping import ClusterMapping
from ibe_rl.ibe.settings import IBEConfig
from ibe_rl.metrics.bootstrap import episode_weights, estimate, weighted_mean
from ibe_rl.task import Phrases, Task
from ibe_rl.types import Array, Episode
from ibe_rl.vocabulary.fitting import fit_mapping

_STRIDE_STEPS = 4
EDGES = (1, 2, 3, 4, 5, 6, 8, 10, 12)
"""Of the bins of movements, in bands (``Task.explained_band``); the same to the other side."""
SMALL = (1, 5)
"""What a small movement is, in bands."""


def variants(paper: IBEConfig, ours: IBEConfig) -> dict[str, MappingConfig]:
    """Both vocabularies, and two between them: the paper's split without min-max, and our split with it."""
    return {
        PAPERS: paper,
        SIGNS_KEPT: replace(paper, normalisation="sign"),
        SPLIT_MINMAX: replace(ours, normalisation="minmax", membership="hard"),
        DEFAULT: ours,
    }


def learn_variants(
    episodes: Sequence[Episode], configs: dict[str, MappingConfig], task: Task, horizon_steps: int, seed: int
) -> dict[str, ClusterMapping]:
    """Learn each vocabulary from the same episodes, from nothing.

    Raises:
        TooLittleDataError: if they are too few.
    """
    return {
        name: fit_mapping(best_of(episodes, config), episodes, config, task, seed, horizon_steps=horizon_steps)
        for name, config in configs.items()
    }


def best_of(episodes: Sequence[Episode], config: MappingConfig) -> list[Episode]:
    """The episodes that a vocabulary is learnt from."""
    rewards = np.array([episode.total_reward for episode in episodes])
    context = np.array([episode.context for episode in episodes])
    among = top_episodes(rewards, config.top_fraction, context if config.top_within == "context" else None)
    return [episode for episode, best in zip(episodes, among, strict=True) if best]


def skew(mapping: ClusterMapping) -> float:
    """Mean expression of the clusters: above 0 they lean to the right, as the paper's do; 0 is balanced."""
    return float(np.mean(mapping.expressions[:, 0]))


def called_zero(mapping: ClusterMapping) -> float | None:
    """What min-max makes of a mean instruction of 0; None if all mean instructions are equal."""
    means = mapping.mean_instructions[:, 0]
    low, high = float(means.min()), float(means.max())
    return None if low == high else -(low + high) / (high - low)


@dataclass(frozen=True)
class LabelShares:
    """What movements were called, in many vocabularies of one kind; the mean over these.

    Attributes:
        straight: ``(W,)`` share of the vocabularies that call it straight.
        wrong: ``(W,)`` share that call it a movement to the other side.
    """

    straight: Array
    wrong: Array


@dataclass(frozen=True)
class LabelledMovements:
    """Movements of episodes that nothing was learnt from.

    Attributes:
        change: ``(W,)`` of the explained dimension.
        weights: ``(R, W)`` of the resampled episodes.
        called: kind of vocabulary to what it calls them.
        band: up to which a movement, either way, is none.
    """

    change: Array
    weights: Array
    called: dict[str, LabelShares]
    band: float


def call(
    episodes: Sequence[Episode],
    vocabularies: Sequence[dict[str, ClusterMapping]],
    task: Task,
    horizon_steps: int,
    resamples: int,
    seed: int,
) -> LabelledMovements:
    """Put what really happened in episodes into the words of many vocabularies of each kind."""
    windows = cut_windows(episodes, horizon_steps, "clamp")
    windows = windows[windows.step % _STRIDE_STEPS == 0]
    change = windows.delta[:, task.explained[0]].astype(float)
    limit = straight_below(task.phrases[0])
    called = {}
    for name in vocabularies[0]:
        said = np.array([learnt[name].express(windows.delta)[:, 0] for learnt in vocabularies])
        straight = np.abs(said) < limit
        wrong = ~straight & (np.sign(said) == -np.sign(change))
        called[name] = LabelShares(straight.mean(axis=0), wrong.mean(axis=0))
    weights = episode_weights(windows.episode, resamples, seed)
    return LabelledMovements(change, weights, called, task.explained_band[0])


def straight_below(words: Phrases) -> float:
    """The magnitude of an expression from which on it is called a movement."""
    return words.degrees[0][0]


def small_rates(tested: LabelledMovements) -> dict[str, dict[str, Any]]:
    """For each kind of vocabulary: how often small movements to either side are called straight, and the wrong way."""
    low, high = (bands * tested.band for bands in SMALL)
    sides = {"left": _within(tested.change, -high, -low), "right": _within(tested.change, low, high)}
    found = {}
    for name, called in tested.called.items():
        rates = {
            (kind, side): weighted_mean(getattr(called, kind)[rows], tested.weights[:, rows])
            for kind in ("straight", "wrong")
            for side, rows in sides.items()
        }
        found[name] = {f"{kind}_{side}": estimate(rate).to_dict() for (kind, side), rate in rates.items()}
        missed = {side: rates["straight", side] + rates["wrong", side] for side in sides}
        found[name]["left_minus_right"] = estimate(missed["left"] - missed["right"]).to_dict()
    return found


def rates_by_movement(tested: LabelledMovements, name: str) -> list[dict[str, Any]]:
    """How often movements of each size are called straight, from far left to far right; empty bins are left out."""
    bands = np.array(EDGES) * tested.band
    edges = np.concatenate([-bands[::-1], bands])
    rows = []
    for low, high in pairwise(edges.tolist()):
        inside = _within(tested.change, low, high)
        if inside.any():
            rate = estimate(weighted_mean(tested.called[name].straight[inside], tested.weights[:, inside]))
            rows.append({"from": float(low), "to": float(high), "windows": int(inside.sum()), **rate.to_dict()})
    return rows


def _within(change: Array, low: float, high: float) -> Array:
    return (change >= low) & (change < high)


def vocabulary_json(mapping: ClusterMapping) -> dict[str, Any]:
    """The clusters, in the order of their expressions, for paper.json."""
    said = mapping.expressions[:, 0]
    return {
        "expressions": said.tolist(),
        "mean_instructions": mapping.mean_instructions[:, 0].tolist(),
        "sizes": mapping.sizes.astype(int).tolist(),
        "ids": mapping.ids.tolist(),
        "skew": skew(mapping),
        "below_zero": len(np.unique(said[said < 0])),
        "above_zero": len(np.unique(said[said > 0])),
        "minmax_of_zero": called_zero(mapping),
    }
