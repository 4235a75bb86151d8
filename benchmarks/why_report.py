"""Many runs to one table."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ibe_rl.metrics.bootstrap import estimate
from ibe_rl.types import Array

FLIES = 0.5
"""A policy that succeeds less often counts as collapsed: its run is kept in a column of its own."""
HEADINGS = ("variant", "motion_auc", "against the paper's", "worst, best run", "seeds", "disobeyed", "Spearman")


def flies(run: dict[str, Any]) -> bool:
    """False for a run whose policy has collapsed."""
    return bool(run["success"] >= FLIES)


def summarise(runs: Sequence[dict[str, Any]], rows: Sequence[dict[str, dict[str, Array]]]) -> list[dict[str, Any]]:
    """One record a variant, means over the runs that fly (over all if none does).

    Args:
        runs: what goes into the JSON.
        rows: of each run, variant to score to ``(R,)`` resamples; row 0 is the value itself.

    Returns:
        Records with ``motion_auc``, ``motion_auc_disobeyed``, ``motion_spearman`` and ``against_paper`` as value with
        interval over episodes; ``by_run``; ``seed_sd``, the standard deviation over clusterings within a run.
    """
    flying = [i for i, run in enumerate(runs) if flies(run)] or list(range(len(runs)))
    keys = [key for key in rows[flying[0]] if all(key in each for each in rows)]
    first, table = keys[0], []
    for key in keys:
        mean = {name: np.mean([rows[i][key][name] for i in flying], axis=0) for name in rows[flying[0]][key]}
        paper = np.mean([rows[i][first]["motion_auc"] for i in flying], axis=0)
        about = {name: runs[flying[0]]["variants"][key][name] for name in ("group", "name", "by_hand")}
        single = [np.array(runs[i]["variants"][key]["motion_auc"], float) for i in flying]
        table.append(
            about
            | {name: short(values) for name, values in mean.items()}
            | {"against_paper": short(mean["motion_auc"] - paper)}
            | {
                "by_run": {
                    run["name"]: _number(each[key]["motion_auc"][0]) for run, each in zip(runs, rows, strict=True)
                }
            }
            | {"seed_sd": _number(np.mean([each.std(ddof=1) if len(each) > 1 else 0.0 for each in single]))}
        )
    return table


def short(values: Array) -> dict[str, float | None]:
    """Row 0 of ``(R,)`` with its interval, for JSON."""
    return {name: None if value is None else round(value, 4) for name, value in estimate(values).to_dict().items()}


def _number(value: float) -> float | None:
    return None if np.isnan(value) else round(float(value), 4)


def markdown(found: dict[str, Any]) -> list[str]:
    """The lines of the table."""
    fallen = [run["name"] for run in found["runs"] if not flies(run)]
    flying = [run["name"] for run in found["runs"] if flies(run)] or [run["name"] for run in found["runs"]]
    fallen = [name for name in fallen if name not in flying]
    headings = [*HEADINGS, *fallen]
    lines = ["| " + " | ".join(headings) + " |", "|---|" + "---:|" * (len(headings) - 1)]
    for group, records in groupby(found["table"], key=lambda record: record["group"]):
        lines.append(f"| **{group}** |" + " |" * (len(headings) - 1))
        lines += ["| " + " | ".join(_cells(record, flying, fallen)) + " |" for record in records]
    return lines


def _cells(record: dict[str, Any], flying: Sequence[str], fallen: Sequence[str]) -> list[str]:
    value, low, high = (record["against_paper"][name] for name in ("value", "low", "high"))
    runs = [record["by_run"][name] for name in flying if record["by_run"][name] is not None]
    return [
        record["name"] + (" (by hand)" if record["by_hand"] else ""),
        digits(record["motion_auc"]["value"]),
        "" if record["name"] == "paper" else f"{digits(value, '+')} [{digits(low, '+')}, {digits(high, '+')}]",
        f"{digits(min(runs))}, {digits(max(runs))}" if runs else "-",
        digits(record["seed_sd"]),
        digits(record["motion_auc_disobeyed"]["value"]),
        digits(record["motion_spearman"]["value"]),
        *(digits(record["by_run"][name]) for name in fallen),
    ]


def digits(value: float | None, sign: str = "") -> str:
    """Three digits behind the point without the 0 before it; a dash for what is not known."""
    return "-" if value is None else f"{value:{sign}.3f}".replace("0.", ".", 1)
