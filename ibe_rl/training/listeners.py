"""Notifies all listeners of a training; holds the listeners that write the run folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from torchrl import timeit

from ibe_rl.collect.schedule import GeometricSchedule, Schedule
from ibe_rl.storage.checkpoint import BETWEEN, save_policy, save_state
from ibe_rl.storage.run_folder import CHECKPOINTS, SUMMARY, MetricsTable, write_json
from ibe_rl.view.relay import News
from ibe_rl.vocabulary.listener import Listener, Refreshed
from ibe_rl.vocabulary.refresh_columns import REFRESH_COLUMNS

LATER_COLUMNS = ("eval/return_mean", "eval/success_rate", *REFRESH_COLUMNS, "ibe/skipped")
"""Columns of metrics.csv that only some rows fill."""


class Listeners(Listener):
    """Notifies all listeners in order and prints their news.

    Args:
        listeners: in the order of notification.
        say: prints a line.
    """

    def __init__(self, listeners: Iterable[Listener], say: Callable[[str], None]):
        self._listeners, self._say, self._frames = list(listeners), say, 0

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        self._frames = run.log.frames
        self._tell(lambda one: one.begin(run))

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """See ``Listener``."""
        self._frames = frames
        self._tell(lambda one: one.batch(frames, row))

    def refreshed(self, event: Refreshed) -> None:
        """See ``Listener``."""
        self._frames = event.frames
        self._tell(lambda one: one.refreshed(event))

    def skipped(self, frames: int, reason: str) -> None:
        """See ``Listener``."""
        self._frames = frames
        self._tell(lambda one: one.skipped(frames, reason))

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """See ``Listener``."""
        self._frames = frames
        self._tell(lambda one: one.evaluated(frames, success_rate, return_mean))

    def end(self, summary: Mapping[str, Any]) -> None:
        """See ``Listener``."""
        self._tell(lambda one: one.end(summary))

    def close(self) -> None:
        """See ``Listener``."""
        self._tell(lambda one: one.close())

    def _tell(self, call: Callable[[Listener], None]) -> None:
        for listener in [*self._listeners]:
            try:
                with timeit(listener.timer):
                    call(listener)
                    lines = [*listener.news()]
            except Exception as error:
                if listener.essential:
                    raise
                self._listeners.remove(listener)
                lines = [self._dropped(listener, error)]
            for line in lines:
                self._say(line)

    def _dropped(self, listener: Listener, error: Exception) -> str:
        name, reason = type(listener).__name__, " ".join(str(error).split())[:200]
        return (
            f"warning: {self._frames:,} frames: the listener {name} failed ({type(error).__name__}: {reason}): it "
            "gets no more events, training goes on"
        )


class Standardised(Listener):
    """Says once what the agent standardises, since its first batch needed it or it was asked to."""

    def __init__(self) -> None:
        self._agent: Any = None  # of a run that never began, none
        self._said: set[str] = set()

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        self._agent, self._said = run.agent, {*getattr(run.agent, "standardised", ())}

    def news(self) -> Iterable[str]:
        """See ``Listener``."""
        new = [name for name in getattr(self._agent, "standardised", ()) if name not in self._said]
        self._said |= {*new}
        return [f"note: the agent standardises {name} (agent.standardise_{name})" for name in new]


class Table(Listener):
    """Writes metrics.csv.

    Args:
        table: the open file.
    """

    essential = True

    def __init__(self, table: MetricsTable):
        self._table = table

    def begin(self, run: Any) -> None:
        """See ``Listener``."""
        self._run = run

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """See ``Listener``."""
        self._table.write({**row, **self._run.time_row()})


class Checkpoints(Listener):
    """Saves the state to resume from, policy weights and, at the end, the summary.

    Args:
        folder: of the run.
        every_frames: between two states; refreshes and evaluations save one too.
        keep_policy_every_frames: between two kept policies, growing with time; None keeps only evaluated ones.
    """

    essential, timer = True, "checkpoint"

    def __init__(self, folder: Path, every_frames: int, keep_policy_every_frames: int | None):
        self._folder, self._often = folder, (every_frames, keep_policy_every_frames)
        self._due_now = self._evaluated = False

    def begin(self, run: Any) -> None:
        """Save the initial state, so that a run killed at any time can be resumed."""
        self._run, frames = run, run.log.frames
        self._state_due, self._policy_due = Schedule(self._often[0], frames), GeometricSchedule(self._often[1], frames)
        if not run.resumed:
            save_state(self._folder, run.state_dict())

    def batch(self, frames: int, row: Mapping[str, float]) -> None:
        """See ``Listener``; ``end`` saves the state of the last batch."""
        if self._policy_due(frames) and not self._evaluated:
            save_policy(self._folder / CHECKPOINTS, frames, self._run.agent.greedy.state_dict(), BETWEEN)
        if self._run.last:
            self._final = self._run.state_dict()
        elif self._state_due(frames) or self._due_now:
            save_state(self._folder, self._run.state_dict())
        self._due_now = self._evaluated = False

    def refreshed(self, event: Refreshed) -> None:
        """See ``Listener``."""
        self._due_now = True

    def skipped(self, frames: int, reason: str) -> None:
        """See ``Listener``."""
        self._due_now = True

    def evaluated(self, frames: int, success_rate: float, return_mean: float) -> None:
        """Save the evaluated weights."""
        self._due_now = self._evaluated = True
        save_policy(self._folder / CHECKPOINTS, frames, self._run.agent.greedy.state_dict())

    def end(self, summary: Mapping[str, Any]) -> None:
        """Write the summary, then the last state: a run killed in between can still be resumed."""
        write_json(self._folder / SUMMARY, summary)
        save_state(self._folder, self._final)


class LiveView(Listener):
    """Reports on the process that serves the live view.

    Args:
        live: its messages, each returned once.
    """

    def __init__(self, live: News):
        self._live = live

    def news(self) -> Iterable[str]:
        """See ``Listener``."""
        return self._live()
