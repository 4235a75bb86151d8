"""What the paper's clusters and ours hold: which moments are lost, what divides them, what the instructor said."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sklearn.linear_model import LinearRegression

from benchmarks.why_variants import AXIS, OURS, PAPER, School, Variant
from ibe_rl.ibe import ClusterMapping, Windows
from ibe_rl.metrics.quality import direction
from ibe_rl.task import Task
from ibe_rl.types import Array

if TYPE_CHECKING:
    from benchmarks.why import Flown

BOTH = (Variant(PAPER, ""), Variant(OURS, "", AXIS))
WAYS = {"down": -1, "stayed": 0, "up": 1}
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def facts(flown: Flown, school: School, seeds: int) -> dict[str, Any]:
    """All of them, means over the clusterings; the pictures of clusters are of the first."""
    task, learnt = flown.task, school.windows(school.base)
    by_name: dict[str, Any] = {}
    for variant in BOTH:
        mappings = [school.learn(variant, seed) for seed in range(seeds)]
        each = [_of_mapping(mapping, flown, learnt) for mapping in mappings]
        by_name[variant.name] = _mean(each) | {"clusters": clusters(mappings[0], flown.windows, task)}
    pointed = weights(school, learnt, task, seeds)
    return by_name | {"learnt_from": _learnt_from(school, learnt, task), "weights": pointed}


def _mean(each: list[dict[str, Any]]) -> dict[str, Any]:
    """Mean of dictionaries of the same shape."""
    if isinstance(each[0], dict):
        return {name: _mean([one[name] for one in each]) for name in each[0]}
    return round(float(np.mean(each)), 4)  # the leaves are numbers


def _of_mapping(mapping: ClusterMapping, flown: Flown, learnt: Windows) -> dict[str, Any]:
    said, told = mapping.express(flown.windows.delta)[:, 0], np.sign(flown.windows.instruction[:, 0])
    way = direction(flown.windows.delta[:, flown.task.explained[0]], flown.task.explained_band[0])
    lost, ties = losses(said, way)
    kinds = {"told 0, moved": (told == 0) & (way != 0), "told 0, stayed": (told == 0) & (way == 0)}
    kinds |= {"told to move, did": (told != 0) & (way == told), "told to move, stayed": (told != 0) & (way == 0)}
    kinds |= {"told to move, went the other way": (told != 0) & (way == -told)}
    kinds |= {"cut short by the end": flown.short}
    kinds |= {f"context {name}": flown.context == name for name in flown.task.contexts}
    parts = {
        name: {"moments": rows.mean(), "loss": share(lost[rows].sum(), lost.sum())} for name, rows in kinds.items()
    }
    divided = dict(
        zip(flown.task.state_names, explained_variance(mapping.cluster(learnt.delta), learnt.delta), strict=True)
    )
    return {"lost": lost.sum(), "tied": ties, "moments": parts, "divided": divided}


def share(part: float, whole: float) -> float:
    """0 where there is nothing to share."""
    return float(part / whole) if whole > 0 else 0.0


def losses(said: Array, way: Array) -> tuple[Array, float]:
    """What each moment has to do with 1 - motion_auc.

    A pair of moments that is put in the wrong order loses 1, one that is tied a half; each of the two moments bears
    half of it.

    Args:
        said: ``(N,)``.
        way: ``(N,)`` -1, 0, 1.

    Returns:
        ``(N,)``, the sum is 1 - motion_auc; and how much of that sum is ties.
    """
    values, rank = np.unique(said, return_inverse=True)
    lost, tied = np.zeros(len(said)), 0.0
    for side in (-1, 1):
        wrong = np.tri(len(values), k=-1).T if side > 0 else np.tri(len(values), k=-1)  # [said of side, said of others]
        pair = wrong + np.eye(len(values)) / 2
        there, others = way == side, way != side
        ahead = np.bincount(rank[there], minlength=len(values)) / max(1, there.sum())
        behind = np.bincount(rank[others], minlength=len(values)) / max(1, others.sum())
        lost[there] += (pair @ behind)[rank[there]] / max(1, there.sum()) / 4
        lost[others] += (ahead @ pair)[rank[others]] / max(1, others.sum()) / 4
        tied += float(ahead @ behind) / 4
    return lost, tied


def explained_variance(labels: Array, delta: Array) -> Array:
    """Share ``(S,)`` of each dimension's variance in changes ``(W, S)`` that lies between the clusters ``(W,)``."""
    sizes = np.maximum(np.bincount(labels), 1)
    means = np.stack([np.bincount(labels, column) / sizes for column in delta.T], axis=1)
    whole = delta.var(axis=0)
    between = np.average((means - delta.mean(axis=0)) ** 2, axis=0, weights=np.bincount(labels))
    return np.divide(between, whole, out=np.zeros_like(whole), where=whole > 0)


def clusters(mapping: ClusterMapping, windows: Windows, task: Task) -> list[dict[str, Any]]:
    """Each cluster in the order of the expressions: what it is called, what really happened where it spoke.

    "down", "stayed", "up": shares of its moments, by the explained dimension; "stands_out": the dimension whose mean
    change in it is farthest from that of all moments, and how far, in standard deviations.
    """
    labels, change = mapping.cluster(windows.delta), windows.delta[:, task.explained[0]]
    scale = np.where(windows.delta.std(axis=0) > 0, windows.delta.std(axis=0), 1)
    standard = (windows.delta - windows.delta.mean(axis=0)) / scale
    told = []
    for i in range(len(mapping.sizes)):
        inside = labels == i
        about: dict[str, Any] = {"moments": int(inside.sum()), "quantiles": None}
        about |= {"expression": round(float(mapping.expressions[i, 0]), 4)}
        about |= {"mean_instruction": round(float(mapping.mean_instructions[i, 0]), 4)}
        if inside.any():
            way, means = direction(change[inside], task.explained_band[0]), standard[inside].mean(axis=0)
            far = int(np.abs(means).argmax())
            about |= {"quantiles": _rounded(np.quantile(change[inside], QUANTILES))}
            about |= {name: round(float(np.mean(way == side)), 4) for name, side in WAYS.items()}
            about |= {"stands_out": [task.state_names[far], round(float(means[far]), 2)]}
        told.append(about)
    return told


def _learnt_from(school: School, learnt: Windows, task: Task) -> dict[str, Any]:
    """The windows of the best episodes: what was said where, and what came of it, in shares of all."""
    names = np.array([episode.context for episode in school.lessons(school.base).best])[learnt.episode]
    told, way = learnt.instruction[:, 0], direction(learnt.delta[:, task.explained[0]], task.explained_band[0])
    values = task.instruction_values
    best = school.lessons(school.base).best
    steps = np.array([len(episode) for episode in best])
    return {
        "windows": len(learnt),
        "episodes": len(best),
        "failed": round(float(np.mean([not episode.success for episode in best])), 4),
        "cut_short": round(float(np.mean(learnt.step + learnt.horizon_steps > steps[learnt.episode])), 4),
        "told_by_context": {
            name: [round(float(np.mean((names == name) & (told == value))), 4) for value in values]
            for name in task.contexts
        },
        "told_by_way": {
            name: [round(float(np.mean((way == side) & (told == value))), 4) for value in values]
            for name, side in WAYS.items()
        },
    }


def weights(school: School, learnt: Windows, task: Task, seeds: int) -> dict[str, Any]:
    """How much each dimension counts, in its standard deviations, the magnitudes adding up to 1.

    "axis": on the instructor's axis, a mean over the seeds; "axis_explained": of the explained dimension alone, seed
    by seed; "regression": in the least-squares regression of the instruction on the change.
    """
    scale = learnt.delta.std(axis=0)
    units = np.eye(len(scale))
    pointed = [school.movement(units, seed) - school.movement(np.zeros_like(units), seed) for seed in range(seeds)]
    axes = np.array([_shares(axis * scale) for axis in pointed])
    regression = _shares(LinearRegression().fit(learnt.delta, learnt.instruction[:, 0]).coef_ * scale)
    return {
        "axis": dict(zip(task.state_names, _rounded(axes.mean(axis=0)), strict=True)),
        "axis_explained": _rounded(axes[:, task.explained[0]]),
        "regression": dict(zip(task.state_names, _rounded(regression), strict=True)),
    }


def _shares(values: Array) -> Array:
    return values / np.abs(values).sum()


def _rounded(values: Array) -> list[float]:
    return np.asarray(values, float).round(4).tolist()
