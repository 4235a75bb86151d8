"""Terminal output: a progress bar, a line at each refresh, a table at the end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.progress import BarColumn, Progress, TimeRemainingColumn
from rich.table import Table

from ibe_rl.config.command_line import command_on
from ibe_rl.runtime.console import PlainColumn, PlainConsole
from ibe_rl.runtime.installation import pasted
from ibe_rl.runtime.printed import visible
from ibe_rl.view import sentences
from ibe_rl.vocabulary.listener import Listener, Refreshed
from ibe_rl.vocabulary.training_episodes import horizon_line

CLOSING_WIDTH = 60
"""Least columns of the closing table: a narrower terminal breaks its lines, and no number is lost."""


class TrainingProgress(Listener):
    """Progress bar over frames with rate, return, success and the last phrase; a context manager.

    Args:
        total_frames: where the bar ends.
    """

    def __init__(self, total_frames: int):
        self._console = PlainConsole(soft_wrap=True)
        self._bar = Progress(
            BarColumn(bar_width=12),
            PlainColumn("{task.percentage:>3.0f}% {task.fields[rate]:,.0f} frames/s"),
            PlainColumn("return {task.fields[reward]:.0f} success {task.fields[success]:.0%}"),
            PlainColumn("“{task.fields[phrase]}”"),
            TimeRemainingColumn(compact=True),
            console=self._console,
        )
        self._total = total_frames
        self._task = self._bar.add_task("", total=total_frames, rate=0.0, reward=float("nan"), success=0.0, phrase="…")

    def __enter__(self) -> TrainingProgress:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._console.print(line)

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        self._run = run

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """Move the bar."""
        reward, success = row["train/return_mean"], row["train/success_rate"]
        shown, rate = min(frames, self._total), frames / self._run.wall_s
        self._bar.update(self._task, completed=shown, rate=rate, reward=reward, success=success)

    def refreshed(self, event: Refreshed) -> None:
        """Report a refresh, and the last phrase of the recorded episode."""
        refresh = event.refresh
        self._bar.update(self._task, phrase=event.said[-1].said)
        if refresh.horizon_found:
            self.say(horizon_line(refresh.top.horizon_steps))
        done = f"refresh {event.number}" if refresh.taken else f"refresh {event.number} keeps the vocabulary"
        words = self._run.task.words
        called = sentences.cluster_phrases(refresh.standing, self._run.task.phrases).values() if words else ()
        numbers = [*dict.fromkeys(called)] or [
            " ".join(f"{value:+.2f}" for value in column) for column in refresh.standing.expressions.T
        ]
        episodes = f"best {refresh.episodes_used} of the newest {refresh.episodes_counted} episodes"
        windows = f"{len(refresh.top):,} windows ({_counts(refresh.windows_by_context)}; "
        self.say(
            f"{done} at {refresh.frame:,} frames: {episodes} ({_counts(refresh.episodes_by_context)}), "
            f"{windows}instruction {_counts(refresh.windows_by_instruction)})\n"
            f"  expressions {' | '.join(numbers)}; {as_predicted(event.came_true)}\n"
            f"  {'; '.join(sentences.moved(refresh)) or 'the first vocabulary'}"
        )
        for line in sentences.worth(refresh, self._run.task):
            self.say(f"  {line}")

    def skipped(self, frames: int, reason: str) -> None:
        """Report a skipped refresh."""
        self.say(f"refresh skipped at {frames:,} frames: {reason}")


def as_predicted(share: float) -> str:
    """The phrase accuracy of a recorded episode, in words."""
    if math.isnan(share):
        return "it gave no explanation of the watched episode"
    return f"{share:.0%} of its explanations of the watched episode went as predicted"


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count:,}" for name, count in counts.items())


def closing_table(summary: Mapping[str, Any], told: Sequence[str] = ()) -> None:
    """Print the summary of a run as a table, without the notes already ``told``."""
    table = Table("what", "value", title="the run in numbers")
    for key in ("frames", "wall_s", "frames_per_s", "episodes", "success_rate", "return_mean", "refreshes"):
        table.add_row(key, f"{summary[key]:,.3g}" if isinstance(summary[key], float) else f"{summary[key]:,}")
    for key in ("refreshes_kept", "refreshes_skipped"):
        table.add_row(key, f"{summary[key]:,}")
    for name, seconds in summary["time_s"].items():
        table.add_row(f"time: {name}", f"{seconds:.1f} s  {seconds / summary['wall_s']:5.1%}")
    console = PlainConsole(soft_wrap=True)
    console.width = max(console.width, CLOSING_WIDTH)
    console.print(table)
    for line in [note for note in summary["notes"] if note not in told]:
        console.print(f"note: {line}")


def how_to_open(folder: Path, in_sweep: bool) -> list[str]:
    """How to view a run again."""
    beside = [f"  beside the others:    {pasted('view', str(folder.parent.absolute()))}"] if in_sweep else []
    return [
        f"the run is in {visible(str(folder))}",
        f"  look at it again:     {pasted('view', str(folder.absolute()))}",
        *beside,
        f"  one episode in words: {command_on(folder, 'explain', 'run')}",
    ]
