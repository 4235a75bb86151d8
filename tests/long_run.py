"""A long training in little time: one batch is collected and repeated, and nothing is learnt from it.

    python tests/long_run.py FRAMES_BETWEEN_REPORTS OVERRIDE ...

All the rest is train.py's: the log, refreshes, watched and explained episodes, evaluations, recording, metrics, states.
Each report is a line of JSON: frames, resident bytes, bytes on disk by what is in the run's folder.
"""

from __future__ import annotations

import json
import resource
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import train
from ibe_rl.agents.ppo import PPO
from ibe_rl.collect.collector import Batches
from ibe_rl.config.command_line import run_script
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.training import build

ROOT = Path(__file__).parent.parent


class OneBatchAgainAndAgain(Batches):
    """Collects once only."""

    def __next__(self) -> Any:
        if not hasattr(self, "_batch"):
            self._batch = super().__next__().clone()
            for name in ("done", "truncated"):  # so that it goes on from itself
                self._batch["next", name][:, -1] = True
        return self._batch.clone()

    def collect_next(self) -> None:
        """Nothing more."""


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def disk_bytes(folder: Path) -> dict[str, int]:
    """What the files take up, by the first part of their path; policies apart from states."""
    sizes: Counter[str] = Counter()
    for path in folder.rglob("*"):
        if path.is_file():
            kind = path.name[:7] if path.parent.name == "checkpoints" else path.relative_to(folder).parts[0]
            sizes[kind] += path.stat().st_blocks * 512
    return dict(sizes)


def report_every(frames: int) -> None:
    """Print a report whenever so many frames have been logged since the last one."""
    real, reported = train.training_row, 0

    def row(log: TrajectoryLog, losses: dict[str, float]) -> dict[str, float]:
        nonlocal reported
        if log.frames // frames > reported:
            reported = log.frames // frames
            found = {"frames": log.frames, "resident": resident_bytes(), "episodes": len(log.index)}
            print(json.dumps(found | {"disk": disk_bytes(log.folder.parent)}), flush=True)  # noqa: T201 - read by the test
        return real(log, losses)

    train.training_row = row


if __name__ == "__main__":
    report_every(int(sys.argv.pop(1)))
    build.Batches = OneBatchAgainAndAgain
    PPO.update = lambda *_: {"policy_loss": 0.0, "value_loss": 0.0, "entropy": 0.0}
    run_script(train.main, ROOT / "configs", "train")
