"""Are explanations true, over several trainings? Judge each run, then interquartile means with intervals.

python -m benchmarks.truth runs/ppo0 runs/ppo1 ... runs/dqn0 ...   judge what is not judged yet, then the report
python -m benchmarks.truth --report runs/ppo0 ...                  the report only
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from benchmarks.run_arguments import finished_runs
from benchmarks.same_runs import FEW
from benchmarks.truth_figures import draw
from benchmarks.truth_report import PAGE, PICTURES, insert_tables
from ibe_rl.apps.sweep.intervals import interquartile
from ibe_rl.storage.run_folder import EVALUATION, SUMMARY, write_json
from ibe_rl.types import Array

console = Console(highlight=False)
RESULTS = Path(__file__).parent / "truth.json"
HORIZON = 60
Summarise = Callable[[Array], list[dict[str, float]]]
"""Values ``(runs, metrics)`` to a mean with its interval for each metric."""
METRICS = (
    *("motion_auc", "motion_auc_words", "motion_auc_disobeyed", "motion_spearman", "vocabulary_loss"),
    *("came_true", "came_true_voted", "phrase_changes_per_100", "flicker", "lag_steps"),
    *("observer_error", "ece", "risk_at_80", "risk_all", "size_cv", "size_max"),
)
MOST = 0.75
"""Least share of the runs that a mean is of."""
JUDGED_BY = ("episodes", "calibration_episodes", "changing_episodes", "stride", "futures", "resamples", "seed")
"""Of the protocol: what all runs of a report have in common."""
QUICK = (*FEW, "evaluate.spoken_episodes=2")
FULL = ("evaluate.spoken_episodes=40", "what_if=false")
"""What is spoken is judged on four times as many episodes as by default: with 20, chance alone gave an ECE of .02."""


def main(arguments: list[str] | None = None) -> None:
    """Judge the runs, put them together and write the report."""
    asked = finished_runs("benchmarks.truth", __doc__.splitlines()[0], arguments)
    if not asked.report:
        for run in asked.runs:
            judge(run, QUICK if asked.quick else FULL)
    refuse_mixed(asked.runs)
    write(put_together([read(run) for run in asked.runs], interquartile), asked.output)


def refuse_mixed(runs: Sequence[Path]) -> None:
    """See that all runs were judged in the same way: what is there may be of other settings.

    Raises:
        SystemExit: naming two that were not.
    """
    first, *others = runs
    for run in others:
        if (one := _judged_by(run)) != (other := _judged_by(first)):
            raise SystemExit(
                f"{run}: judged with {one}, {first} with {other}; allowed are runs judged alike: "
                f"without its folder {EVALUATION} a run is judged again"
            )


def _judged_by(run: Path) -> dict[str, Any]:
    quality = json.loads((run / EVALUATION / "quality.json").read_text())
    about = {name: quality["protocol"].get(name) for name in JUDGED_BY}
    return about | {"spoken_episodes": quality.get("spoken", {}).get("episodes")}


def write(together: dict[str, Any], output: Path | None) -> None:
    """Write the numbers, pictures and tables where they are in the repository, or all into ``output``."""
    (output or PICTURES).mkdir(parents=True, exist_ok=True)
    write_json(output / RESULTS.name if output else RESULTS, together)
    draw(together, output or PICTURES)
    insert_tables(together, output / PAGE.name if output else PAGE)


def judge(run: Path, extra: Sequence[str] = ()) -> None:
    """Let explain.py judge a run, with other settings if need be, unless that has been done."""
    for task, made in (("evaluate", "observers.json"), ("compare", "compare.json")):
        if not (run / EVALUATION / made).exists():
            console.print(f"{run.name}: task={task}")
            command = [sys.executable, "explain.py", f"run={run}", f"task={task}", "viewer=off", *extra]
            quiet = {"env": {**os.environ, "OMP_NUM_THREADS": "1"}, "stdout": subprocess.DEVNULL}
            subprocess.run(command, check=True, **quiet)  # noqa: S603 - our own


def read(run: Path) -> dict[str, Any]:
    """What was judged of one run: explainer to metric to value, at the horizon of the report."""
    summary = json.loads((run / SUMMARY).read_text())
    quality, compared = (json.loads((run / EVALUATION / name).read_text()) for name in ("quality.json", "compare.json"))
    ours = f"ibe:{quality['protocol']['mapping']}"
    told = {f"refit:{row['explainer'].removeprefix('ibe:')}": row for row in compared["rows"]}
    told |= {row["explainer"]: row for row in quality["rows"] if row["horizon_steps"] == HORIZON}
    told |= {row["explainer"]: row for row in quality.get("spoken", {}).get("rows", ())}
    observers = json.loads((run / EVALUATION / "observers.json").read_text())["rows"]
    told |= {
        row["explainer"]: {"observer_error": row["observer_error"]}
        for row in observers
        if row["explainer"] in ("no_explanation", "words_alone")
    }
    return {
        "name": run.name,
        "agent": summary["agent"],
        "seed": summary["seed"],
        "success_rate": summary["success_rate"],
        "ours": ours,
        "values": {name: {metric: _value(row.get(metric)) for metric in METRICS} for name, row in told.items()},
        "left_right": told[ours]["left_right"]["value"],
        "horizons": {row["horizon_steps"]: row["motion_auc"] for row in quality["rows"] if row["explainer"] == ours},
        "velocity_at": {
            row["horizon_steps"]: row["motion_auc"]
            for row in quality["rows"]
            if row["explainer"] == "baseline:present_velocity"
        },
        "over_velocity": _paired(quality["paired"], "baseline:present_velocity"),
        "over_regressor": _paired(quality["paired"], "baseline:state_regressor"),
        "risk": quality["confidence"]["risk_at_80_minus_risk_all"],
        "observers": {row["explainer"]: row for row in observers},
        "shuffled": next(
            row["refits"]["motion_auc"]
            for row in quality["rows"]
            if row["explainer"] == "baseline:shuffled" and row["horizon_steps"] == HORIZON
        ),
        "changing_policy": _last_policy(quality["changing_policy"]),
    }


def _value(told: Any) -> float | None:
    """The value of an estimate with its interval, or a number as it is; None for anything else."""
    value = told["value"] if isinstance(told, dict) else told
    return None if isinstance(value, list) else value


def _last_policy(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the report tells of the last policy in the vocabularies of all ages."""
    last = max((row["policy_frame"] for row in rows), default=0)
    kept = ("vocabulary_frame", "motion_auc", "refreshed_minus_this")
    return [{key: row[key] for key in kept} for row in rows if row["policy_frame"] == last]


def _paired(rows: list[dict[str, Any]], minus: str) -> Any:
    return next(
        row["difference"]
        for row in rows
        if row["minus"] == minus and row["metric"] == "motion_auc" and row["horizon_steps"] == HORIZON
    )


def put_together(runs: list[dict[str, Any]], summarise: Summarise) -> dict[str, Any]:
    """Means over the runs of each kind of agent, with intervals.

    A metric that some runs lack, as one whose agent cannot tell what its words mean lacks calibration, is that of the
    others, with how many they are (``runs``); None if they are fewer than ``MOST``.
    """
    by_agent = defaultdict(list)
    for run in runs:
        by_agent[run["agent"]].append(run)
    return {"runs": runs, "iqm": {agent: _of_agent(several, summarise) for agent, several in by_agent.items()}}


def _of_agent(runs: list[dict[str, Any]], summarise: Summarise) -> dict[str, Any]:
    names = list(runs[0]["values"])
    every = {(n, metric): [run["values"].get(n, {}).get(metric) for run in runs] for n in names for metric in METRICS}
    whole = {key: values for key, values in every.items() if None not in values}
    means = summarise(np.array(list(whole.values()), float).T)
    found: dict[str, Any] = {name: dict.fromkeys(METRICS) for name in names}
    for (name, metric), mean in zip(whole, means, strict=True):
        found[name][metric] = mean
    for (name, metric), values in every.items():
        known = [value for value in values if value is not None]
        if MOST * len(values) <= len(known) < len(values):
            [mean] = summarise(np.array(known, float)[:, None])
            found[name][metric] = mean | {"runs": len(known)}
    return found


if __name__ == "__main__":
    main()
