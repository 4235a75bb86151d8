"""Interquartile means over runs with bootstrap intervals, as in Agarwal et al. (2021)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from ibe_rl.apps.sweep.records import RunCurve
from ibe_rl.types import Array

REPS = 5_000
"""Resamples of the runs."""
CURVE_POINTS = 60
"""Most points of a curve."""
Ends = dict[str, dict[str, Any]]
Curves = dict[str, dict[str, list[float]]]


def interquartile(values: Array, reps: int = REPS) -> list[dict[str, float]]:
    """Interquartile means of ``(runs, columns)``, each with the 95 % interval of a percentile bootstrap over runs."""
    drawn = np.random.default_rng(0).integers(len(values), size=(reps, len(values)))
    return [_interval(column, drawn) for column in values.T]


def interquartile_ratio(one: Array, other: Array, reps: int = REPS) -> dict[str, float]:
    """The interquartile mean of runs ``(n,)`` over that of others ``(m,)``, with its interval over both, as above."""
    draw = np.random.default_rng(0).integers
    means = [trim_mean(each[draw(len(each), size=(reps, len(each)))], 0.25, axis=1) for each in (one, other)]
    low, high = np.percentile(means[0] / means[1], [2.5, 97.5])
    return {"value": float(trim_mean(one, 0.25) / trim_mean(other, 0.25)), "low": float(low), "high": float(high)}


def _interval(each: Array, drawn: Array) -> dict[str, float]:
    low, high = np.percentile(trim_mean(each[drawn], 0.25, axis=1), [2.5, 97.5])
    return {"value": float(trim_mean(each, 0.25)), "low": float(low), "high": float(high)}


def of_runs(ends: Sequence[Mapping[str, float]], curves: Mapping[str, Sequence[RunCurve]]) -> tuple[Ends, Curves]:
    """Aggregate the final values and curves of several runs.

    Args:
        ends: final values of each run by metric; a run may lack some.
        curves: curves of all runs by column.

    Returns:
        metric to its ``value`` with ``low`` and ``high`` (None if only one run has it), the number of ``runs`` that
        have it, and the value of ``each``;
        column to ``frames``, ``value``, ``low`` and ``high``, empty lists if the runs have no frames in common.
    """
    metrics = dict.fromkeys(metric for one in ends for metric in one)
    known = {metric: [one[metric] for one in ends if metric in one] for metric in metrics}
    put = {metric: _end(values) for metric, values in known.items()}
    return put, {column: _curve(several) for column, several in curves.items()}


def _end(each: list[float]) -> dict[str, Any]:
    [mean] = interquartile(np.array(each, float)[:, None])
    bounds = {"low": None, "high": None} if len(each) == 1 else {}
    return {**mean, **bounds, "runs": len(each), "each": each}


def _curve(curves: Sequence[RunCurve]) -> dict[str, list[float]]:
    frames = common_frames(curves)
    means = interquartile(np.array([np.interp(frames, *one) for one in curves]))
    return {"frames": frames.tolist()} | {name: [one[name] for one in means] for name in ("value", "low", "high")}


def common_frames(curves: Sequence[RunCurve]) -> Array:
    """Frames at which to compare curves: those of the curve with the fewest, within the range of all curves."""
    start, end = max(frames[0] for frames, _ in curves), min(frames[-1] for frames, _ in curves)
    fewest = min((frames for frames, _ in curves), key=len)
    shared = fewest[(fewest >= start) & (fewest <= end)]
    return shared[np.unique(np.linspace(0, len(shared) - 1, CURVE_POINTS).astype(int))] if len(shared) else shared
