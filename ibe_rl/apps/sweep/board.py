"""Terminal output of a sweep: a status line for each current run, the outcome of each, a table at the end."""

from __future__ import annotations

import csv
import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rich.progress import BarColumn, Progress, TaskID
from rich.table import Column, Table

from ibe_rl.apps.sweep.jobs import DONE, DONE_BEFORE, FAILED, OUTPUT, Job, Outcome, read_summary
from ibe_rl.runtime.console import PlainColumn, PlainConsole
from ibe_rl.runtime.installation import pasted
from ibe_rl.storage.run_folder import METRICS

TAIL_BYTES = 20_000
"""Bytes read from the end of a growing table: a few rows."""


@dataclass
class _Line:
    task: TaskID
    since: float
    frames_then: int


class Board:
    """Status lines of the runs of a sweep; a context manager.

    Args:
        console: to print to.
    """

    def __init__(self, console: PlainConsole) -> None:
        self._console = console
        self._lines: dict[Job, _Line] = {}
        self._counts: Counter[str] = Counter()
        self._bars = Progress(
            PlainColumn("{task.description}"),
            BarColumn(bar_width=12),
            PlainColumn("{task.fields[said]}"),
            console=console,
        )
        self._whole = self._bars.add_task("sweep", said="")

    def __enter__(self) -> Board:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def begin(self, done_before: Sequence[Outcome], jobs: int) -> None:
        """Print the number of runs and those that are finished already."""
        self._bars.update(self._whole, total=jobs)
        for outcome in done_before:
            self._count(outcome)
            self.say(f"{outcome.job.name}: finished earlier, left as it is")

    def started(self, job: Job, goes_on: bool) -> None:
        """Add the line of a run."""
        frames = int(newest_row(job.folder / METRICS).get("frames", 0)) if goes_on else 0
        task = self._bars.add_task(job.name, total=job.total_frames, completed=frames, said="starts")
        self._lines[job] = _Line(task, time.monotonic(), frames)
        self.say(f"{job.name}: {f'resumes at about {frames:,} frames' if goes_on else 'begins'}, in {job.folder}")

    def moved(self, job: Job) -> None:
        """Update the line of a run."""
        line, row = self._lines[job], newest_row(job.folder / METRICS)
        frames = int(row.get("frames", 0))
        if frames:
            rate = max(0, frames - line.frames_then) / (time.monotonic() - line.since)
            reward, success = row.get("train/return_mean", math.nan), row.get("train/success_rate", math.nan)
            said = f"{frames:,} frames, {rate:,.0f}/s, return {reward:.0f}, success {success:.0%}"
            self._bars.update(line.task, completed=min(frames, job.total_frames), said=said)

    def ended(self, outcome: Outcome) -> None:
        """Replace the line of a run by its outcome."""
        line = self._lines.pop(outcome.job, None)
        if line:
            self._bars.remove_task(line.task)
        self._count(outcome)
        self.say(": ".join(part for part in (outcome.job.name, outcome.became, outcome.why) if part))

    def say(self, text: str) -> None:
        """Print a line above the status lines."""
        self._console.print(text, soft_wrap=True)

    def _count(self, outcome: Outcome) -> None:
        self._counts[outcome.became] += 1
        said = ", ".join(f"{number} {what}" for what, number in self._counts.items())
        self._bars.update(self._whole, completed=self._counts.total(), said=said)


def newest_row(path: Path) -> dict[str, float]:
    """The numbers of the last complete row of a table that may be growing; empty without one."""
    try:
        with path.open("rb") as stream:
            head = stream.readline()
            stream.seek(max(len(head), path.stat().st_size - TAIL_BYTES))
            lines = stream.read().split(b"\n")
    except FileNotFoundError:
        return {}
    if len(lines) < 2:
        return {}
    names, values = next(csv.reader([head.decode()])), next(csv.reader([lines[-2].decode()]), [])
    return {name: float(value) for name, value in zip(names, values, strict=False) if value}


def outcomes_table(outcomes: Sequence[Outcome]) -> Table:
    """The outcome and score of every run."""
    name = Column("run", overflow="fold")
    table = Table(name, "", "frames", "success", "return", title="the sweep in numbers", title_justify="left")
    for outcome in outcomes:
        summary = read_summary(outcome.job.folder) if outcome.became in (DONE, DONE_BEFORE) else None
        scores = (
            (f"{summary['frames']:,}", f"{summary['success_rate']:.1%}", f"{summary['return_mean']:.1f}")
            if summary
            else ()
        )
        table.add_row(outcome.job.name, outcome.became, *(scores or ("-", "-", "-")))
    return table


def failures(outcomes: Sequence[Outcome]) -> list[str]:
    """For each failed run its reason and its output file."""
    return [
        f"failed: {one.job.name}: {one.why}\n  what it printed: {one.job.folder / OUTPUT}"
        for one in outcomes
        if one.became == FAILED
    ]


def viewer_command(sweep: Path) -> str:
    """The command that shows all runs of a sweep."""
    return pasted("view", str(sweep.absolute()))
