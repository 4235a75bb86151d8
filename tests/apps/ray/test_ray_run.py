"""A command on a Ray cluster is as if it ran here: its output, its exit status, Ctrl-C, and the end of its machine."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import gone, rows_in, start
from test_ray_workers import HERE_ONLY, RUN, cluster, family, needs_ray, raylet
from view_data import eventually

from ibe_rl.apps.ray.run import Command
from ibe_rl.runtime.operating_system import command_line_of
from ibe_rl.runtime.signals import interrupts_stay_here

__all__ = ["cluster"]
MODULE = ("-m", "ibe_rl.apps.ray.run")


def test_a_command_is_read_until_its_end():
    command = Command([sys.executable, "-c", "import os; print(os.getcwd()); print('ready', flush=True); input()"], "/")
    text, status = b"", None
    while status is None:
        new, status = command.read(interrupt=False)
        text += new
    assert text.startswith(b"/\nready\n")
    assert b"EOFError" in text
    assert status == 1


def test_a_command_is_interrupted_also_where_interrupts_are_kept_away():
    with interrupts_stay_here():
        command = Command([sys.executable, "-c", "import time; print('ready', flush=True); time.sleep(60)"], "/")
    text = b""
    while not text:
        text, _ = command.read(interrupt=False)
    status = None
    command.read(interrupt=True)
    while status is None:
        _, status = command.read(interrupt=False)
    assert status == -signal.SIGINT


@pytest.fixture
def begin(cluster: Any) -> Iterator[Any]:
    """Start a command on the cluster."""
    started = []

    def run(*command: str, address: str = cluster.address) -> Any:
        started.append(start(*MODULE, address, "1", sys.executable, *command, **HERE_ONLY))
        return started[-1]

    yield run
    for one in started:
        if one.poll() is None:
            os.killpg(one.pid, signal.SIGKILL)
        one.wait()


@needs_ray
@pytest.mark.soak
def test_output_and_exit_status_come_back(begin: Any):
    run = begin("-c", "print('hello'); raise SystemExit(3)")
    output, _ = run.communicate(timeout=240)
    assert (run.returncode, output) == (3, "hello\n")


@needs_ray
@pytest.mark.soak
def test_ctrl_c_stops_a_training_elsewhere_in_order(begin: Any, tmp_path: Path):
    run = begin("train.py", *RUN, "collect.processes=1", "total_frames=100000000", f"run_dir={tmp_path}/run")
    assert eventually(lambda: rows_in(tmp_path / "run") > 2, within_s=120)
    run.send_signal(signal.SIGINT)
    output, _ = run.communicate(timeout=240)
    assert run.returncode == 0, output
    assert "the run is in" in output
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["stopped_early"]


@needs_ray
@pytest.mark.soak
def test_the_end_of_its_machine_is_said_and_ends_it(begin: Any, cluster: Any):
    run = begin("-c", "import time; print('ready', flush=True); time.sleep(600)")
    assert run.stdout.readline() == "ready\n"
    raylets = [raylet(node) for node in (cluster.head_node, *cluster.worker_nodes)]
    [actor] = [one for pid in raylets for one in family(pid) if "Command" in command_line_of(one)]
    everybody = family(actor)
    assert len(everybody) > 1
    os.kill(actor, signal.SIGKILL)
    output, _ = run.communicate(timeout=240)
    assert run.returncode == 1
    assert "error: the machine that it ran on, or Ray there, is gone" in output
    assert eventually(lambda: all(gone(one) for one in everybody))


@needs_ray
@pytest.mark.soak
def test_no_cluster_is_said(begin: Any):
    run = begin("-c", "print('hello')", address="nowhere")
    output, _ = run.communicate(timeout=240)
    assert run.returncode == 1
    assert output.startswith("error: HOST:PORT=nowhere: allowed is the address of a Ray cluster")


@needs_ray
@pytest.mark.soak
def test_a_sweep_runs_on_the_cluster(cluster: Any, tmp_path: Path):
    asked = ["-m", "seed=0,1", *RUN, "collect.processes=1", f"run_dir={tmp_path}", f"runs_on={cluster.address}"]
    sweep = start("train.py", *asked, "runs_at_once=2", **HERE_ONLY)
    output, _ = sweep.communicate(timeout=300)
    assert sweep.returncode == 0, output
    found = [json.loads(path.read_text())["seed"] for path in sorted(tmp_path.glob("*/summary.json"))]
    assert found == [0, 1]
