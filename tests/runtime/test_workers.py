"""A worker that dies or hangs ends the run in one line, with a state that resumes; none outlives the trainer."""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest
from copies import Script
from processes import SMALL, call, gone, partial_episodes, rows_in
from view_data import eventually

from ibe_rl.collect import collector as collect
from ibe_rl.collect.collector import make_collector
from ibe_rl.config.settings import InstructorConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.runtime import workers
from ibe_rl.runtime.installation import pasted
from ibe_rl.runtime.operating_system import children_of, command_line_of
from ibe_rl.runtime.signals import interrupts_stay_here, script_stays_here
from ibe_rl.runtime.workers import LostWorkerError, ending, next_of
from ibe_rl.storage.run_folder import METRICS, read_rows
from ibe_rl.training.failure import resumable
from tests.collect.test_collector import ENV, make_dqn, sizes

RUN = [*SMALL, "viewer=off", "total_frames=100000000", "collect.envs_per_process=2", "refresh_every_frames=null"]
FEW_S = 5.0


def workers_of(trainer: int) -> list[int]:
    """The processes that collect, or predict."""
    servers = [child for child in children_of(trainer) if "forkserver" in command_line_of(child)]
    return [worker for server in servers for worker in children_of(server)]


@pytest.fixture
def training(tmp_path: Path) -> Iterator[Callable[..., Script]]:
    """Start a training of ``run`` and wait for its first rows."""
    with ExitStack() as started:
        yield lambda *more: started.enter_context(partial_episodes(tmp_path / "run", *RUN, *more))


SETTINGS = pytest.mark.parametrize("settings", [("collect.processes=2",), ("collect.overlap=true",)])


@SETTINGS
@pytest.mark.parametrize(
    ("number", "what"),
    [
        (signal.SIGKILL, r"has ended \(SIGKILL\)"),
        (signal.SIGSTOP, rf"hangs: no batch for {FEW_S:g} s \(collect.timeout_s\)"),
    ],
)
def test_a_worker_that_dies_or_hangs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], settings: tuple[str], number: int, what: str
):
    folder, others, crew = tmp_path / "run", workers_of(os.getpid()), list[int]()

    def harm() -> None:
        eventually(lambda: rows_in(folder) > 2)
        crew.extend(worker for worker in workers_of(os.getpid()) if worker not in others)
        os.kill(crew[-1], number)

    harming = Thread(target=harm)
    harming.start()
    limit = [f"collect.timeout_s={FEW_S}"] if number == signal.SIGSTOP else []  # by default a worker may take 300 s
    with pytest.raises(SystemExit) as ended:
        call("train", *RUN, *settings, *limit, f"run_dir={folder}")
    harming.join()
    printed = capfd.readouterr()
    assert "Traceback" not in printed.out + printed.err
    name = rf"worker {len(crew) - 1} of {len(crew)} \(process {crew[-1]}\)"
    again = re.escape(pasted("train"))
    line = rf"error: {name} {what}; the run is saved as of ([\d,]+) frames, to go on: {again} (.+)"
    found = re.fullmatch(line, str(ended.value.code))
    assert found, ended.value.code
    assert eventually(lambda: all(gone(worker) for worker in crew))
    frames = int(found[1].replace(",", ""))
    assert frames >= int(read_rows(folder / METRICS)[-1]["frames"])
    if number == signal.SIGSTOP:  # its state is kept in the same way
        return
    call("train", *found[2].split(), "viewer=off", f"total_frames={frames + 1}", "eval_episodes=1")
    assert json.loads((folder / "summary.json").read_text())["frames"] > frames


def test_nobody_outlives_a_trainer_that_is_killed(training: Any, tmp_path: Path):
    settings = ("collect.processes=2", "predictor.processes=2", "viewer=live", "explain_every_steps=1")
    run = training(*settings, "refresh_every_frames=3000", "collect.envs_per_process=8")
    assert eventually(lambda: len(workers_of(run.pid)) == 4)
    family = children_of(run.pid)
    family += [grandchild for child in family for grandchild in children_of(child)]
    assert len(family) > 5
    assert (tmp_path / "run" / "recording.rrd").exists()
    run.kill()
    assert eventually(lambda: all(gone(one) for one in family))


def sleeps(*_: Any, **__: Any) -> Any:
    time.sleep(600)


def dies(*_: Any, **__: Any) -> Any:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize(
    ("behaviour", "within_s", "why"), [(sleeps, 2.0, r"not ready within 2 s"), (dies, 120.0, "Worker 0 failed")]
)
def test_a_worker_that_never_gets_ready(behaviour: Any, within_s: float, why: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(collect, "env_of_worker", behaviour)
    monkeypatch.setattr(workers, "START_S", within_s)
    config = sizes(2)
    config.timeout_s = 1.0
    with pytest.raises(LostWorkerError, match=f"the workers could not be started: {why}"):
        make_collector(make_dqn(), ENV, config, LANDER_TASK, InstructorConfig(), seed=3)


def test_what_workers_are_copies_of_has_ended():
    why = "could not be started: the process that they are copies of has ended$"
    with pytest.raises(LostWorkerError, match=why), workers.starting(None):
        raise EOFError("unexpected EOF")  # of multiprocessing, from its fork server


class Crew:
    """In the place of workers."""

    def __init__(self, dead: list[str], silent: list[str]):
        self.names, self._dead, self._silent, self.killed = ["worker 0", "worker 1"], dead, silent, False

    def dead(self, _error: Exception | None = None) -> list[str]:
        return self._dead

    def silent(self) -> list[str]:
        return self._silent

    def kill(self) -> None:
        self.killed = True


def brought(*things: Any) -> SimpleQueue[Any]:
    queue: SimpleQueue[Any] = SimpleQueue()
    for thing in things:
        queue.put(thing)
    return queue


def test_a_batch_that_was_brought_counts_also_of_the_dead():
    crew = Crew(["worker 1 has ended"], [])
    coming = brought("batch")
    assert next_of(coming, crew, 10.0) == "batch"
    with pytest.raises(LostWorkerError, match=r"^worker 1 has ended$"):
        next_of(coming, crew, 10.0)
    assert crew.killed


def test_an_error_is_that_of_the_dead_or_its_own():
    with pytest.raises(LostWorkerError, match="worker 1"):
        next_of(brought(BrokenPipeError("deep inside")), Crew(["worker 1 has ended"], []), None)
    with pytest.raises(ZeroDivisionError):
        next_of(brought(ZeroDivisionError()), Crew([], []), None)


def test_too_late_is_said_otherwise_than_hanging():
    for silent, said in ((["worker 0", "worker 1"], "worker 0 and worker 1 hangs"), ([], "the workers are too slow")):
        crew = Crew([], silent)
        with pytest.raises(LostWorkerError, match=f"^{said}: no batch for 0.3 s"):
            next_of(brought(), crew, 0.3)
        assert crew.killed


def test_a_worker_lost_before_the_first_batch_leaves_nothing_to_resume():
    parts: Any = SimpleNamespace(log=SimpleNamespace(frames=0))
    said = r"^worker 1; nothing had been collected yet, start the run again$"
    with pytest.raises(LostWorkerError, match=said), resumable(parts):
        raise LostWorkerError("worker 1")
    with pytest.raises(ZeroDivisionError), resumable(parts):
        raise ZeroDivisionError


def test_how_a_process_ended():
    assert [ending(-9), ending(-15), ending(3)] == ["SIGKILL", "SIGTERM", "exit status 3"]


@pytest.mark.parametrize(("before", "during"), [("spawn", "forkserver"), ("fork", "fork")])
def test_processes_start_as_copies_unless_a_program_has_chosen(
    before: str, during: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(workers, "process_start_method", lambda: "forkserver")
    mine, loading = multiprocessing.get_start_method(), []
    monkeypatch.setattr(workers.forkserver, "ensure_running", lambda: loading.append(before))
    multiprocessing.set_start_method(before, force=True)
    try:
        with workers.start_method_for_torchrl():
            assert multiprocessing.get_start_method() == during
        assert multiprocessing.get_start_method() == before
        for without in (["collect.processes=1"], ["seed=1", "collect.engine=ray"], ["--help"], ["-m", "seed=0,1"]):
            workers.preload_workers(without)
        assert loading == []
        workers.preload_workers(["collect.processes=16"])  # what they are copies of
        assert loading == (["spawn"] if during == "forkserver" else [])
    finally:
        multiprocessing.set_start_method(mine, force=True)


def test_what_cannot_be_started_early_is_told_when_it_is_needed(monkeypatch: pytest.MonkeyPatch):
    def refuse() -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(workers, "process_start_method", lambda: "forkserver")
    monkeypatch.setattr(workers.forkserver, "ensure_running", refuse)
    workers.preload_workers()


@pytest.mark.skipif(workers.process_start_method() != "forkserver", reason="workers are copies only there")
def test_a_worker_looks_for_no_garbage_among_what_it_is_a_copy_of():
    with interrupts_stay_here(), script_stays_here(), ProcessPoolExecutor(1, workers.process_context()) as pool:
        imported, left_alone = pool.submit(_is_imported, "torchrl").result(), pool.submit(gc.get_freeze_count).result()
    assert imported
    assert left_alone > 100_000


def _is_imported(module: str) -> bool:
    return module in sys.modules
