"""How sure a mean over runs is: interquartile means with stratified bootstrap intervals, by rliable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from itertools import islice
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from ibe_rl.apps.sweep.records import RunCurve
from ibe_rl.types import Array, ConfigError

REPS = 5_000
"""Resamples of the runs."""
CURVE_POINTS = 60
"""Of a curve, at most."""
Ends = dict[str, dict[str, Any]]
Curves = dict[str, dict[str, list[float]]]


def check_installed() -> None:
    """Refuse early what could not be finished.

    Raises:
        ConfigError: if rliable is not there.
    """
    if find_spec("rliable") is None:
        raise ConfigError(
            "sweep: the intervals of its report need rliable, which is not installed; pip install -e '.[sweep]'"
        )


def interquartile(values: Array, reps: int = REPS) -> list[dict[str, float]]:
    """Interquartile means of ``(runs, columns)``, each with the 95 % interval of a bootstrap over the runs."""
    from rliable import library  # an extra, and slow to import

    np.random.seed(0)  # noqa: NPY002 - rliable draws from here, whatever generator it is given
    means, intervals = library.get_interval_estimates(
        {"all": values}, lambda sample: trim_mean(sample, 0.25, axis=0), reps=reps
    )
    columns = zip(means["all"], *intervals["all"], strict=True)
    return [{"value": float(value), "low": float(low), "high": float(high)} for value, low, high in columns]


def together(parts: Mapping[str, Array]) -> dict[str, list[dict[str, float]]]:
    """Interquartile means of several ``(runs, columns)`` by their names; resampled at once, which is faster."""
    found: dict[str, list[dict[str, float]]] = {}
    for count in sorted({len(values) for values in parts.values()}):
        those = {name: values for name, values in parts.items() if len(values) == count and values.size}
        means = iter(interquartile(np.hstack(list(those.values()))) if those else [])
        found |= {name: list(islice(means, values.shape[1])) for name, values in those.items()}
    return {name: found.get(name, []) for name in parts}


def of_runs(ends: Sequence[Mapping[str, float]], curves: Mapping[str, Sequence[RunCurve]]) -> tuple[Ends, Curves]:
    """What some runs ended on, and their curves, put together.

    Args:
        ends: of each run, by metric; a run may lack some.
        curves: by column; of each run.

    Returns:
        metric to its ``value`` with ``low`` and ``high``, which are None where only one run has it, how many ``runs``
        have it, and what ``each`` of these has;
        column to ``frames``, ``value``, ``low`` and ``high``, empty lists where the runs have no frames in common.
    """
    metrics = dict.fromkeys(metric for one in ends for metric in one)
    known = {metric: [one[metric] for one in ends if metric in one] for metric in metrics}
    grids = {column: common_frames(several) for column, several in curves.items()}
    parts = {metric: np.array(values, float)[:, None] for metric, values in known.items()}
    drawn = {
        f"curve {column}": np.array([np.interp(grids[column], *one) for one in several])
        for column, several in curves.items()
    }
    found = together(parts | drawn)
    put = {metric: _end(found[metric][0], values) for metric, values in known.items()}
    return put, {column: _curve(grids[column], found[f"curve {column}"]) for column in curves}


def _end(mean: Mapping[str, float], each: list[float]) -> dict[str, Any]:
    bounds = {"low": None, "high": None} if len(each) == 1 else {}
    return {**mean, **bounds, "runs": len(each), "each": each}


def _curve(frames: Array, means: Sequence[Mapping[str, float]]) -> dict[str, list[float]]:
    return {"frames": frames.tolist()} | {name: [one[name] for one in means] for name in ("value", "low", "high")}


def common_frames(curves: Sequence[RunCurve]) -> Array:
    """Frames at which to compare curves that may stand at others: of the one with the fewest, where all of them are."""
    start, end = max(frames[0] for frames, _ in curves), min(frames[-1] for frames, _ in curves)
    fewest = min((frames for frames, _ in curves), key=len)
    shared = fewest[(fewest >= start) & (fewest <= end)]
    return shared[np.unique(np.linspace(0, len(shared) - 1, CURVE_POINTS).astype(int))] if len(shared) else shared
