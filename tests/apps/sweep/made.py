"""A sweep made by hand: run folders with curves of a known shape, as far as the report reads them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml

from ibe_rl.storage.run_folder import MetricsTable

LATER = ("eval/success_rate", "eval/return_mean", "ibe/motion_auc", "ibe/came_true")


def run(folder: Path, overrides: Sequence[str], level: float = 0.5, frames: int = 1000, finished: bool = True) -> Path:
    """Success rises to ``level`` over ten rows, the last two of which are evaluated; the AUC is a half more."""
    (folder / ".hydra").mkdir(parents=True)
    (folder / ".hydra" / "config.yaml").touch()
    (folder / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump([*overrides, f"run_dir={folder}"]))
    with MetricsTable(folder / "metrics.csv", LATER) as table:
        for number, success in enumerate(np.linspace(0, level, 10), start=1):
            row = {"frames": frames * number // 10, "train/return_mean": 100 * success, "train/success_rate": success}
            late = {
                "eval/success_rate": success,
                "eval/return_mean": 100 * success,
                "ibe/motion_auc": 0.5 + success / 2,
            }
            table.write({**row, "time/learn": number, **(late if number > 8 else {})})
    if finished:
        (folder / "summary.json").write_text(json.dumps({"stopped_early": False, "frames": frames}))
    return folder


def sweep(folder: Path, levels: Mapping[str, Sequence[float]]) -> Path:
    """A run for each setting and level, with the seeds 0, 1, ..."""
    number = 0
    for setting, several in levels.items():
        for seed, level in enumerate(several):
            run(folder / f"{number}_{setting}_seed={seed}", [setting, f"seed={seed}", "total_frames=1000"], level)
            number += 1
    return folder


def judge(folder: Path, **values: float) -> None:
    """What ``explain.py task=evaluate`` leaves, as far as it is read."""
    (folder / "evaluation").mkdir()
    metrics = {name: {"value": value, "low": None, "high": None} for name, value in values.items()}
    rows = [
        {"explainer": "baseline:paper", "horizon_steps": 60, **metrics},
        {"explainer": "ibe:axis", "horizon_steps": 20, "motion_auc": {"value": 0.0}},
        {"explainer": "ibe:axis", "horizon_steps": 60, **metrics},
    ]
    quality = {"protocol": {"mapping": "axis", "horizon_steps": 60}, "rows": rows}
    (folder / "evaluation" / "quality.json").write_text(json.dumps(quality))
