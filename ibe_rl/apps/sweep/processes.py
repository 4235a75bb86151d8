"""Run the jobs of a sweep, each in a process of its own, some at once; a failed one does not end the others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ibe_rl.apps.sweep.board import Board
from ibe_rl.apps.sweep.jobs import (
    DONE,
    DONE_BEFORE,
    FAILED,
    FINISHED,
    NEW,
    NOT_BEGUN,
    OUTPUT,
    STOPPED,
    Job,
    Outcome,
    last_line,
    make_way,
    state_of,
)
from ibe_rl.runtime.signals import StopRequest, killed_with_parent
from ibe_rl.runtime.workers import ending
from ibe_rl.types import ConfigError

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR", "VECLIB_MAXIMUM")}
_POLL_S = 0.3
PATIENCE_S = 10.0
CommandOf = Callable[[Job, bool], list[str]]
"""From a job and whether it goes on to the command that runs it."""


@dataclass
class Running:
    """A job under way.

    Attributes:
        job: what it is.
        process: of train.py, the leader of a session of its own: Ctrl-C in the terminal does not reach it.
        output: where it prints to.
        begins: of what it prints, in bytes; before it is what it printed another time.
        told_to_stop: whether it was.
    """

    job: Job
    process: subprocess.Popen[bytes]
    output: Path
    begins: int
    told_to_stop: bool = False

    def stop(self) -> None:
        """Let it end in order; a second signal would end it at once."""
        if not self.told_to_stop:
            self.process.send_signal(signal.SIGINT)
        self.told_to_stop = True

    def outcome(self) -> Outcome | None:
        """What became of it; None while it runs."""
        status = self.process.poll()
        if status is None:
            return None
        if status == 0:
            return Outcome(self.job, DONE if state_of(self.job.folder) == FINISHED else STOPPED)
        if self.told_to_stop:
            return Outcome(self.job, STOPPED)
        died = f"killed by {ending(status)}; " if status < 0 else ""
        return Outcome(self.job, FAILED, f"{died}{last_line(self.output, self.begins)}")


def run_all(jobs: Sequence[Job], command: CommandOf, at_once: int, board: Board) -> list[Outcome]:
    """Run those of the jobs that are not finished; Ctrl-C and SIGTERM stop all in order, a second one at once.

    Args:
        jobs: in the order in which they begin.
        command: that runs one.
        at_once: how many run side by side.
        board: shows how they come along.

    Raises:
        ConfigError: if the summary of one that ended before cannot be read.
    """
    done = [Outcome(job, DONE_BEFORE) for job in jobs if state_of(job.folder) == FINISHED]
    waiting = [job for job in jobs if job not in {one.job for one in done}]
    running: list[Running] = []
    board.begin(done, len(jobs))
    with StopRequest() as stop, board:
        try:
            while running or (waiting and not stop):
                while waiting and len(running) < at_once and not stop:
                    done += _start(waiting.pop(0), command, running, board)
                time.sleep(_POLL_S)
                done += _look_after(running, bool(stop), board)
        finally:
            _end_at_once(running)
    every = [*done, *(Outcome(job, NOT_BEGUN) for job in waiting)]
    return sorted(every, key=lambda outcome: jobs.index(outcome.job))


def _start(job: Job, command: CommandOf, running: list[Running], board: Board) -> list[Outcome]:
    """Start a job; what became of it if it cannot be."""
    goes_on = state_of(job.folder) != NEW
    try:
        if not goes_on:
            make_way(job.folder)
        job.folder.mkdir(parents=True, exist_ok=True)
        with (job.folder / OUTPUT).open("ab") as output:
            process = subprocess.Popen(  # noqa: S603 - our own
                command(job, goes_on),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=os.environ | ONE_THREAD | {"PYTHONUNBUFFERED": "1"},
                start_new_session=True,
                preexec_fn=killed_with_parent(),  # no run outlives a sweep that is killed
            )
            running.append(Running(job, process, job.folder / OUTPUT, output.tell()))
    except (ConfigError, OSError) as error:
        failed = Outcome(job, FAILED, str(error))
        board.ended(failed)
        return [failed]
    board.started(job, goes_on)
    return []


def _look_after(running: list[Running], stop: bool, board: Board) -> list[Outcome]:
    """Show how each comes along, tell it to stop if it shall; what became of those that have ended."""
    ended = []
    for one in list(running):
        if stop:
            one.stop()
        board.moved(one.job)
        outcome = one.outcome()
        if outcome:
            running.remove(one)
            ended.append(outcome)
            board.ended(outcome)
    return ended


def _end_at_once(running: Sequence[Running]) -> None:
    """End what still runs, which is nothing unless something went wrong or Ctrl-C came twice."""
    for one in running:
        one.process.terminate()
    until = time.monotonic() + PATIENCE_S
    for one in running:
        try:
            one.process.wait(max(0.0, until - time.monotonic()))
        except subprocess.TimeoutExpired:
            os.killpg(one.process.pid, signal.SIGKILL)  # with the processes that it has started
            one.process.wait()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
