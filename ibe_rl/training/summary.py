"""The columns of metrics.csv and the contents of summary.json."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import Array, Episode

PACKAGES = ("ibe_rl", "torch", "torchrl", "tensordict", "gymnasium", "scikit-learn", "rerun-sdk")


def training_row(log: TrajectoryLog, losses: dict[str, float]) -> dict[str, float]:
    """The columns of every row of metrics.csv; means are over the newest 100 episodes."""
    index = log.index
    means = {
        "train/return_mean": recent_mean(index["total_reward"], 100),
        "train/success_rate": recent_mean(index["success"], 100),
        "train/episode_steps": recent_mean(index["steps"], 100),
    }
    return {"frames": log.frames} | means | {f"train/{name}": loss for name, loss in losses.items()}


def evaluation_row(episodes: Sequence[Episode]) -> dict[str, float]:
    """The columns of metrics.csv that an evaluation fills."""
    return {
        "eval/return_mean": float(np.mean([episode.total_reward for episode in episodes])),
        "eval/success_rate": float(np.mean([episode.success for episode in episodes])),
    }


def recent_mean(values: Array, count: int) -> float:
    """Mean of the newest ``count`` of ``values``; NaN if there are none."""
    return float(np.mean(values[-count:])) if len(values) else float("nan")


def summarise(run: Any, row: dict[str, float]) -> dict[str, Any]:
    """The contents of summary.json; ``row`` is the last one of metrics.csv, empty if the run failed."""
    cfg, counts, vocabulary, wall_s = run.cfg, run.counts, run.vocabulary, run.wall_s
    return {
        "frames": run.log.frames,
        "wall_s": wall_s,
        "frames_per_s": run.log.frames / wall_s,
        "episodes": run.log.episodes_ended,
        "success_rate": row.get("eval/success_rate"),
        "return_mean": row.get("eval/return_mean"),
        "evaluation_episodes": cfg.eval_episodes,
        "horizon_steps": vocabulary.horizon_steps,
        "refreshes": counts.refreshes,
        "refreshes_kept": counts.kept,
        "refreshes_skipped": counts.skipped,
        "stopped_early": bool(run.stop),
        "meaning": [one.to_dict() for one in vocabulary.mapping.meanings] if vocabulary.mapping else [],
        "notes": [*run.notes, *vocabulary.notes],
        "standardised": list(getattr(run.agent, "standardised", ())),
        "time_s": run.times_s(),
        "seed": cfg.seed,
        "agent": cfg.agent.kind,
        "mapping": cfg.mapping.kind,
        "versions": {name: version(name) for name in PACKAGES},
    }
