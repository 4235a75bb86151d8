"""A small training as loggers hear it, without one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from view_data import TASK, filmed, refreshed

from ibe_rl.agents.dqn import DQNConfig
from ibe_rl.config.settings import TrainConfig
from ibe_rl.explain.phrasing import ExplainerState
from ibe_rl.training.listeners import Listeners
from ibe_rl.vocabulary.listener import Listener, Refreshed


def run(folder: Path, resumed_at: int | None = None) -> Any:
    """What loggers read of a run; its folder exists."""
    folder.mkdir(exist_ok=True)
    log = SimpleNamespace(frames=resumed_at or 0)
    cfg = TrainConfig(agent=DQNConfig(kind="dqn", hidden=[8, 8]), run_dir=str(folder))
    times = {"time/learn": 1.5}
    return SimpleNamespace(
        cfg=cfg, folder=folder, log=log, task=TASK, resumed=resumed_at is not None, time_row=lambda: times
    )


def event(frames: int) -> Refreshed:
    """A refresh at these frames."""
    rollout, said, real = filmed()
    refresh = refreshed()
    voice = ExplainerState(refresh.mapping, 20, TASK.phrases)
    return Refreshed(frames, 1, refresh, rollout, said, real, voice, came_true=1.0)


def train(logger: Listener, run: Any, *, until: int) -> list[str]:
    """Batches of 10 frames with a refresh at 20; returns the lines said."""
    lines: list[str] = []
    listeners = Listeners([logger], lines.append)
    listeners.begin(run)
    for frames in range(run.log.frames + 10, until + 1, 10):
        row = {"frames": float(frames), "train/return_mean": frames / 2, "train/loss": float("nan")}
        if frames == 20:
            listeners.refreshed(event(frames))
        listeners.batch(frames, row)
    listeners.skipped(until, "too little <b>")
    listeners.end({"frames": until, "success_rate": 0.5})
    listeners.close()
    listeners.close()
    return lines
