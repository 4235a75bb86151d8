"""Jobs as real processes, of a few lines each: failures, Ctrl-C, and what is done again."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from processes import gone
from rich.console import Console
from view_data import eventually

from ibe_rl.apps.sweep import processes
from ibe_rl.apps.sweep.board import Board, failures, newest_row, outcomes_table
from ibe_rl.apps.sweep.jobs import DONE, DONE_BEFORE, FAILED, NOT_BEGUN, STOPPED, Job, Outcome
from ibe_rl.apps.sweep.processes import run_all
from ibe_rl.runtime import signals
from ibe_rl.storage.run_folder import MetricsTable

FINISHES = """
import json, os, sys
folder = sys.argv[1]
json.dump({"stopped_early": False, "frames": 10, "success_rate": 0.5, "return_mean": 1.0},
          open(folder + "/summary.json", "w"))
print("threads", os.environ["OMP_NUM_THREADS"], "goes on", sys.argv[2])
"""
FAILS = "print('all well'); raise ValueError('no such luck')"
DIES = "import os; os.kill(os.getpid(), 9)"
STOPS = """
import json, signal, sys, time
count = []
def stop(number, frame):
    count.append(number)
signal.signal(signal.SIGTERM, stop)
open(sys.argv[1] + "/up", "w").close()
while not count: time.sleep(.05)
time.sleep(.5)  # a second signal would be heard here
json.dump({"stopped_early": True, "signals": count}, open(sys.argv[1] + "/summary.json", "w"))
"""
STUBBORN = """
import signal, sys, time
for number in (signal.SIGINT, signal.SIGTERM): signal.signal(number, signal.SIG_IGN)
open(sys.argv[1] + "/up", "w").close()
time.sleep(600)
"""


MEETS = """
import pathlib, sys, time
print(time.time())
folder = pathlib.Path(sys.argv[1])
(folder / "up").touch()
while len(list(folder.parent.glob("*/up"))) < 2: time.sleep(.05)
time.sleep(.5)  # a third would be seen here
print(time.time())
"""


def job(folder: Path) -> Job:
    return Job(folder.name, folder, (), 100)


def going(**codes: str) -> Callable[[Job, bool], list[str]]:
    """Runs the piece of Python that a job's name stands for."""
    return lambda job, goes_on: [sys.executable, "-c", codes[job.name], str(job.folder), str(goes_on)]


def board() -> tuple[Board, io.StringIO]:
    said = io.StringIO()
    return Board(Console(file=said, width=200)), said


def all_up(*folders: Path) -> bool:
    return all((folder / "up").exists() for folder in folders)


def interrupt(when: Callable[[], bool], number: signal.Signals = signal.SIGINT, after: float = 0) -> threading.Thread:
    """Send this process a signal as soon as something is so."""

    def wait() -> None:
        assert eventually(when)
        time.sleep(after)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


def test_a_run_that_ends_at_once_says_why_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Ended(subprocess.Popen[bytes]):
        def __init__(self, *arguments: Any, **settings: Any):
            super().__init__(*arguments, **settings)
            self.wait()

    monkeypatch.setattr(processes.subprocess, "Popen", Ended)
    [outcome] = run_all([job(tmp_path / "fails")], going(fails=FAILS), 1, board()[0])
    assert outcome.why == "ValueError: no such luck"


def test_a_failed_run_does_not_end_the_others_and_says_why(tmp_path: Path) -> None:
    jobs = [job(tmp_path / name) for name in ("fails", "dies", "finishes")]
    shown, said = board()
    outcomes = run_all(jobs, going(fails=FAILS, dies=DIES, finishes=FINISHES), 1, shown)
    assert [(one.job.name, one.became, one.why) for one in outcomes] == [
        ("fails", FAILED, "ValueError: no such luck"),
        ("dies", FAILED, "killed by SIGKILL; no output"),
        ("finishes", DONE, ""),
    ]
    assert "fails: failed: ValueError: no such luck\n" in said.getvalue()
    assert "2 failed, 1 finished" in said.getvalue()
    assert "all well" in (tmp_path / "fails" / "output.log").read_text()
    assert (tmp_path / "finishes" / "output.log").read_text() == "threads 1 goes on False\n"
    assert failures(outcomes)[0].endswith(f"what it printed: {tmp_path / 'fails' / 'output.log'}")
    assert len(failures(outcomes)) == 2


def test_what_is_finished_stays_what_has_a_state_goes_on_and_the_rest_begins(tmp_path: Path) -> None:
    done, begun, new = jobs = [job(tmp_path / name) for name in ("done", "begun", "new")]
    run_all([done], going(done=FINISHES), 1, board()[0])
    before = (done.folder / "summary.json").stat().st_mtime_ns
    (begun.folder / "checkpoints").mkdir(parents=True)
    (begun.folder / "checkpoints" / "latest.pt").touch()
    (begun.folder / "output.log").write_text("as it was\n")
    shown, said = board()
    outcomes = run_all(jobs, going(begun=FINISHES, new=FINISHES), 2, shown)
    assert [one.became for one in outcomes] == [DONE_BEFORE, DONE, DONE]
    assert (done.folder / "summary.json").stat().st_mtime_ns == before
    assert (begun.folder / "output.log").read_text() == "as it was\nthreads 1 goes on True\n"
    assert (new.folder / "output.log").read_text() == "threads 1 goes on False\n"
    assert "done: finished earlier" in said.getvalue()


def test_what_it_said_another_time_is_not_why_it_failed(tmp_path: Path) -> None:
    (tmp_path / "fails").mkdir()
    (tmp_path / "fails" / "output.log").write_text("error: an old one\n")
    [outcome] = run_all([job(tmp_path / "fails")], going(fails="import sys; sys.exit(3)"), 1, board()[0])
    assert (outcome.became, outcome.why) == (FAILED, "no output")


def test_several_run_at_once_but_no_more_than_asked_for(tmp_path: Path) -> None:
    code = MEETS + FINISHES
    jobs = [job(tmp_path / name) for name in "abc"]
    run_all(jobs, going(a=code, b=code, c=code), 2, board()[0])
    spans = [[float(line) for line in (one.folder / "output.log").read_text().split()[:2]] for one in jobs]
    (a, a_end), (b, b_end), (c, _) = spans
    assert b < a_end
    assert a < b_end
    assert c >= min(a_end, b_end)


def test_ctrl_c_stops_all_in_order_and_begins_no_more(tmp_path: Path) -> None:
    jobs = [job(tmp_path / name) for name in "abc"]
    thread = interrupt(lambda: all_up(jobs[0].folder, jobs[1].folder))
    outcomes = run_all(jobs, going(a=STOPS, b=STOPS, c=STOPS), 2, board()[0])
    thread.join()
    assert [one.became for one in outcomes] == [STOPPED, STOPPED, NOT_BEGUN]
    for one in jobs[:2]:  # one signal each: a second one ends a run at once
        assert json.loads((one.folder / "summary.json").read_text())["signals"] == [signal.SIGTERM]
    assert not jobs[2].folder.exists()


def test_a_run_that_cannot_end_in_order_counts_as_stopped(tmp_path: Path) -> None:
    code = "import sys, time; open(sys.argv[1] + '/up', 'w').close(); time.sleep(600)"
    thread = interrupt(lambda: all_up(tmp_path / "a"))
    [outcome] = run_all([job(tmp_path / "a")], going(a=code), 1, board()[0])
    thread.join()
    assert (outcome.became, outcome.why) == (STOPPED, "")


def test_a_second_ctrl_c_ends_all_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "PATIENCE_S", 0.5)
    monkeypatch.setattr(signals, "ONE_PRESS_S", 0.0)
    started: list[subprocess.Popen[bytes]] = []
    real = subprocess.Popen

    def popen(*args: object, **settings: object) -> subprocess.Popen[bytes]:
        started.append(real(*args, **settings))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", popen)
    threads = [interrupt(lambda: all_up(tmp_path / "a"), after=after) for after in (0, 1)]
    with pytest.raises(KeyboardInterrupt):
        run_all([job(tmp_path / "a")], going(a=STUBBORN), 1, board()[0])
    for thread in threads:
        thread.join()
    assert gone(started[0].pid)


def test_a_run_that_cannot_be_started_does_not_end_the_others(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a file, not a folder")
    outcomes = run_all([job(tmp_path / "a"), job(tmp_path / "b")], going(b=FINISHES), 1, board()[0])
    assert [one.became for one in outcomes] == [FAILED, DONE]
    assert "exists" in outcomes[0].why.lower() or "not a directory" in outcomes[0].why.lower()


def test_the_newest_row_of_a_growing_table(tmp_path: Path) -> None:
    path = tmp_path / "metrics.csv"
    assert newest_row(path) == {}
    with MetricsTable(path, ["eval/success_rate"]) as table:
        table.write({"frames": 10, "train/return_mean": -1.5})
        assert newest_row(path) == {"frames": 10, "train/return_mean": -1.5}
        for frames in range(20, 20_000, 10):
            table.write({"frames": frames, "train/return_mean": 2.5})
    with path.open("a") as stream:
        stream.write("20000,3")
    assert newest_row(path) == {"frames": 19_990, "train/return_mean": 2.5}
    path.write_text("frames,train/return")
    assert newest_row(path) == {}


def test_a_line_follows_the_frames_of_its_run(tmp_path: Path) -> None:
    one, (shown, said) = job(tmp_path), board()
    with shown:
        shown.begin([], 1)
        shown.started(one, goes_on=False)
        shown.moved(one)  # there is no table yet
        with MetricsTable(tmp_path / "metrics.csv") as table:
            table.write({"frames": 40, "train/return_mean": -12.0, "train/success_rate": 0.25})
        shown.moved(one)
    assert "40 frames" in said.getvalue()
    assert "return -12, success 25%" in said.getvalue()


def test_the_table_at_the_end_has_the_scores(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text(json.dumps({"frames": 4000, "success_rate": 0.125, "return_mean": 33.3}))
    said = io.StringIO()
    Console(file=said, width=100).print(outcomes_table([Outcome(job(tmp_path), DONE), Outcome(job(tmp_path), STOPPED)]))
    assert "4,000" in said.getvalue()
    assert "12.5%" in said.getvalue()
    assert said.getvalue().count("33.3") == 1
