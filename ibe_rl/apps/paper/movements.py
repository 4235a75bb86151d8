"""The paper's preliminary experiment: do the best episodes follow the instructions more than the others?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ibe_rl.ibe.delta import cut_windows, top_episodes
from ibe_rl.metrics.effect import Effect, Groups, effect
from ibe_rl.metrics.histogram import BINS, bin_edges, densities
from ibe_rl.task import Task
from ibe_rl.types import Array, Episode


@dataclass(frozen=True)
class Movements:
    """How the explained dimension changed after each instruction, in ``W`` windows of ``E`` episodes.

    Attributes:
        change: ``(W,)`` over the horizon, to the end of the episode where that is shorter.
        instruction: ``(W,)`` the one at the beginning.
        episode: ``(W,)`` number of the episode.
        best: ``(E,)`` bool, by total reward over all episodes, as in the paper.
        best_of_context: ``(E,)`` bool, by total reward among the episodes of the same context.
        context: ``(E,)`` names.
    """

    change: Array
    instruction: Array
    episode: Array
    best: Array
    best_of_context: Array
    context: Array

    def changes(self, instruction: float, best: bool) -> Array:
        """All changes after one instruction in the best or in the other episodes."""
        return self.change[(self.instruction == instruction) & (self.best[self.episode] == best)]


def movements_of(episodes: Sequence[Episode], task: Task, horizon_steps: int, top_fraction: float) -> Movements:
    """Cut episodes into windows; only where something was instructed."""
    windows = cut_windows(episodes, horizon_steps, "clamp")
    windows = windows[np.asarray(windows.given)]
    rewards = np.array([episode.total_reward for episode in episodes])
    context = np.array([episode.context for episode in episodes])
    return Movements(
        change=windows.delta[:, task.explained[0]].astype(float),
        instruction=windows.instruction[:, 0],
        episode=windows.episode,
        best=top_episodes(rewards, top_fraction),
        best_of_context=top_episodes(rewards, top_fraction, context),
        context=context,
    )


def histogram(moves: Movements, instruction: float, bins: int = BINS) -> dict[str, Any]:
    """The densities of the changes after one instruction, best and other episodes over the same bins, for paper.json.

    ``shown_to`` is the third highest density, so that a peak over two bins need not hide the rest.
    """
    groups = {"best": moves.changes(instruction, best=True), "others": moves.changes(instruction, best=False)}
    edges = bin_edges(moves.change, bins)
    both = densities([*groups.values()], edges)
    found: dict[str, Any] = {"edges": edges.tolist(), "shown_to": float(np.sort(np.max(both, axis=0))[-3])}
    for (name, values), density in zip(groups.items(), both, strict=True):
        mean = float(np.mean(values)) if len(values) else None
        found[name] = {"windows": len(values), "mean": mean, "density": density.tolist()}
    return found


def followed(moves: Movements, instruction: float) -> tuple[Array, Array]:
    """How far each episode went the instructed way.

    Returns:
        Numbers ``(F,)`` of the episodes with this instruction, and their mean movement the instructed way.
        After 0 it is the negative mean magnitude of the movement: staying is what was asked for.
    """
    rows = moves.instruction == instruction
    way = np.sign(instruction) * moves.change[rows] if instruction else -np.abs(moves.change[rows])
    episodes, place = np.unique(moves.episode[rows], return_inverse=True)
    return episodes, np.bincount(place, way) / np.bincount(place)


def claim_effects(moves: Movements, instruction: float, resamples: int, seed: int) -> dict[str, Effect | None]:
    """Test the paper's claim for one instruction, by episode: over all contexts, and within each of them.

    Returns:
        "all" as the paper does it, then each context by itself, then "within": all contexts together, but episodes
        only compared with those of the same context. None where one of the groups is empty.
    """
    episodes, values = followed(moves, instruction)
    contexts = {name: _groups(episodes, values, moves, name) for name in np.unique(moves.context).tolist()}
    best = moves.best[episodes]
    strata: dict[str, Sequence[Groups]] = {"all": [(values[best], values[~best])]}
    strata |= {name: [groups] for name, groups in contexts.items()}
    strata["within"] = list(contexts.values())
    return {name: effect(groups, resamples, seed) for name, groups in strata.items()}


def _groups(episodes: Array, values: Array, moves: Movements, context: str) -> Groups:
    here, best = moves.context[episodes] == context, moves.best_of_context[episodes]
    return values[here & best], values[here & ~best]


def holds(found: Effect | None) -> str:
    """Whether best episodes follow more: "yes" or "no" if the interval is clear of no difference, else "open"."""
    if found is None or np.isnan(found.superiority.low):
        return "open"
    return "yes" if found.superiority.low > 0.5 else "no" if found.superiority.high < 0.5 else "open"


def effect_json(found: Effect | None) -> dict[str, Any] | None:
    """For paper.json."""
    if found is None:
        return None
    return {
        "best_episodes": found.counts[0],
        "other_episodes": found.counts[1],
        "best_mean": found.means[0],
        "others_mean": found.means[1],
        "difference": found.difference.to_dict(),
        "superiority": found.superiority.to_dict(),
        "holds": holds(found),
    }
