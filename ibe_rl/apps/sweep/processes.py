"""Run the jobs of a sweep as processes, several at once; a failed job does not end the others."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ibe_rl.apps.sweep.board import Board
from ibe_rl.apps.sweep.jobs import (
    DONE,
    DONE_BEFORE,
    FAILED,
    NEW,
    NOT_BEGUN,
    OUTPUT,
    RUN_FINISHED,
    STOPPED,
    Job,
    Outcome,
    last_line,
    make_way,
    state_of,
)
from ibe_rl.runtime.operating_system import killed_with_parent
from ibe_rl.runtime.signals import StopRequest
from ibe_rl.runtime.workers import ending
from ibe_rl.types import ConfigError

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR", "VECLIB_MAXIMUM")}
_POLL_S = 0.3
PATIENCE_S = 10.0
CommandOf = Callable[[Job, bool], list[str]]
"""From a job, and whether to resume it, to its command."""


@dataclass
class Running:
    """A running job.

    Attributes:
        job: the job.
        process: train.py as the leader of its own session: what this process's group is sent does not reach it.
        output: file that it prints to.
        begins: offset in bytes where the output of this start begins.
        stop_requested: whether it was asked to stop.
    """

    job: Job
    process: subprocess.Popen[bytes]
    output: Path
    begins: int
    stop_requested: bool = False

    def stop(self) -> None:
        """Ask it to stop in order, also if a batch system has done so too: a second SIGTERM changes nothing."""
        if not self.stop_requested:
            self.process.send_signal(signal.SIGTERM)
        self.stop_requested = True

    def outcome(self) -> Outcome | None:
        """Its outcome; None while it runs."""
        status = self.process.poll()
        if status is None:
            return None
        if status == 0:
            return Outcome(self.job, DONE if state_of(self.job.folder) == RUN_FINISHED else STOPPED)
        if self.stop_requested:
            return Outcome(self.job, STOPPED)
        died = f"killed by {ending(status)}; " if status < 0 else ""
        return Outcome(self.job, FAILED, f"{died}{last_line(self.output, self.begins)}")


def run_all(jobs: Sequence[Job], command: CommandOf, at_once: int, board: Board) -> list[Outcome]:
    """Run the unfinished jobs; Ctrl-C or SIGTERM stops all in order, Ctrl-C after that at once.

    Args:
        jobs: in the order of their start.
        command: of a job.
        at_once: number of jobs side by side.
        board: shows their progress.

    Raises:
        ConfigError: if the summary of a job cannot be read.
    """
    done = [Outcome(job, DONE_BEFORE) for job in jobs if state_of(job.folder) == RUN_FINISHED]
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
    """Start a job; returns its outcome if it cannot be started."""
    goes_on = state_of(job.folder) != NEW
    try:
        if not goes_on:
            make_way(job.folder)
        job.folder.mkdir(parents=True, exist_ok=True)
        with (job.folder / OUTPUT).open("ab") as output:
            begins = output.tell()  # before the run writes: it has the same place in the file
            process = subprocess.Popen(  # noqa: S603 - our own
                command(job, goes_on),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=os.environ | ONE_THREAD | {"PYTHONUNBUFFERED": "1"},
                start_new_session=True,
                preexec_fn=killed_with_parent(),  # no run outlives a killed sweep
            )
            running.append(Running(job, process, job.folder / OUTPUT, begins))
    except (ConfigError, OSError) as error:
        failed = Outcome(job, FAILED, str(error))
        board.ended(failed)
        return [failed]
    board.started(job, goes_on)
    return []


def _look_after(running: list[Running], stop: bool, board: Board) -> list[Outcome]:
    """Show the progress of each job, stop it if asked to; returns the outcomes of those that ended."""
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
    """Kill the jobs that still run, after an error or a second Ctrl-C."""
    for one in running:
        one.process.send_signal(signal.SIGINT)  # Ctrl-C ends at once what has been asked to stop
    until = time.monotonic() + PATIENCE_S
    for one in running:
        try:
            one.process.wait(max(0.0, until - time.monotonic()))
        except subprocess.TimeoutExpired:
            os.killpg(one.process.pid, signal.SIGKILL)  # with its child processes
            one.process.wait()
