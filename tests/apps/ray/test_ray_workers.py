"""Collection over Ray: what is refused without it, and, with it, the same as in processes, on two nodes too."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from processes import ROOT, SMALL, gone, partial_episodes
from tensordict import TensorDictBase
from view_data import eventually

from ibe_rl.apps.ray import workers as ray_workers
from ibe_rl.apps.ray.workers import Actors, RayWorkers
from ibe_rl.collect.check import check_collect
from ibe_rl.collect.collector import Batches, make_collector
from ibe_rl.config.settings import CollectConfig, InstructorConfig
from ibe_rl.envs import LANDER_TASK
from ibe_rl.instructors import check_instructor
from ibe_rl.instructors.recorded import RecordedConfig
from ibe_rl.runtime.operating_system import children_of, command_line_of
from ibe_rl.runtime.workers import LostWorkerError
from ibe_rl.storage.run_folder import METRICS, read_rows
from ibe_rl.types import ConfigError
from tests.collect.test_collector import ENV, always, make_dqn, sizes

INSTALLED = importlib.util.find_spec("ray") is not None
needs_ray = pytest.mark.skipif(not INSTALLED, reason="Ray is not installed: make soak does")
RUN = [
    *SMALL,
    *("viewer=off", "collect.processes=2", "collect.envs_per_process=4", "refresh_every_frames=null"),
]
HERE_ONLY = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_USAGE_STATS_ENABLED": "0"}
"""Lets Ray listen on 127.0.0.1 only, on Linux too."""


def test_ray_is_refused_where_it_is_not_installed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ray_workers, "find_spec", lambda _: None)
    with pytest.raises(
        ConfigError, match=r"^collect\.engine=ray: Ray is not installed \(pip install 'ibe_rl\[ray\]'\)"
    ):
        check_collect(CollectConfig(engine="ray"))
    check_collect(CollectConfig())


def test_an_address_is_refused_where_nobody_connects_to_it():
    with pytest.raises(ConfigError, match=r"^collect\.address=here:1 with collect\.engine=processes: allowed is null"):
        check_collect(CollectConfig(address="here:1"))


def test_an_address_where_nobody_answers_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ray_workers, "find_spec", lambda _: True)
    with socket.create_server(("127.0.0.1", 0)) as server:
        there = f"127.0.0.1:{server.getsockname()[1]}"
        check_collect(CollectConfig(engine="ray", address=there))
    for address in (there, "auto", "127.0.0.1:99999", "127.0.0.1:"):
        with pytest.raises(ConfigError, match=rf"^collect\.address={address}: allowed is host:port of a Ray cluster"):
            check_collect(CollectConfig(engine="ray", address=address))


def test_a_lesson_is_not_given_over_ray():
    config = RecordedConfig(recording="somewhere")
    with pytest.raises(ConfigError, match=r"^collect\.engine=ray with instructor=recorded: allowed is processes"):
        check_instructor(config, CollectConfig(engine="ray", processes=1), LANDER_TASK)


def gather(engine: str, workers: int = 2) -> list[TensorDictBase]:
    """Batches of an agent that explores, and then learns to fire the main engine and not to explore."""
    agent, config = make_dqn(), sizes(workers)
    config.engine = engine
    collector = make_collector(agent, ENV, config, LANDER_TASK, InstructorConfig(), seed=3)
    try:
        with closing(Batches(collector, agent, overlap=False, timeout_s=60.0)) as source:
            gathered = [next(source).clone(), next(source).clone()]
            always(agent, 2)
            return [*gathered, next(source).clone()]
    finally:
        collector.shutdown()


@needs_ray
@pytest.mark.soak
def test_batches_over_ray_are_those_of_processes():
    """In the order of the workers, with the weights and epsilon of the trainer, to the last bit."""
    before = signal.getsignal(signal.SIGTERM)
    over_ray, expected = gather("ray"), gather("processes")
    assert signal.getsignal(signal.SIGTERM) == before
    assert (over_ray[-1]["action"] == 2).all()
    assert not (over_ray[0]["action"] == 2).all()
    for batch, other in zip(over_ray, expected, strict=True):
        assert batch.shape == other.shape
        assert (batch.exclude("collector") == other.exclude("collector")).all()


def listening(pids: set[int]) -> dict[str, int]:
    """Addresses that processes listen on, other than this machine's own."""
    open_files = [(link, pid) for pid in pids for link in Path(f"/proc/{pid}/fd").iterdir() if link.exists()]
    sockets = {link.stat().st_ino: pid for link, pid in open_files}
    found = {}
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            local, state, inode = (line.split()[at] for at in (1, 3, 9))
            if state == "0A" and int(inode) in sockets:
                found[local] = sockets[int(inode)]
    return found


def family(pid: int) -> set[int]:
    return {pid}.union(*(family(child) for child in children_of(pid)))


@pytest.fixture
def training(tmp_path: Path) -> Iterator[Any]:
    """Start a training over Ray and wait for its first rows."""
    endless = ["collect.engine=ray", "total_frames=100000000"]
    with ExitStack() as started:
        yield lambda *more: started.enter_context(
            partial_episodes(tmp_path / "run", *RUN, *endless, *more, within_s=180, **HERE_ONLY)
        )


@needs_ray
@pytest.mark.soak
def test_ray_of_a_run_is_for_it_alone_and_ends_with_it(training: Any):
    """Killed, it leaves nobody behind; before that nobody could reach it from another machine."""
    run = training()
    everybody = family(run.pid)
    addresses = listening(everybody)
    assert len(everybody) > 4
    assert len(addresses) > 3
    assert {address for address in addresses if not address.rpartition(":")[0].endswith("0100007F")} == set()
    run.kill()
    assert eventually(lambda: all(gone(one) for one in everybody), within_s=120)  # two of Ray's agents wait a minute


@needs_ray
@pytest.mark.soak
def test_ctrl_c_ends_a_run_over_ray_in_order(training: Any, tmp_path: Path):
    run = training()
    everybody = family(run.pid)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does: to all of them
    output, _ = run.communicate(timeout=240)
    assert run.returncode == 0, output
    assert "Traceback" not in output
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["stopped_early"]
    assert eventually(lambda: all(gone(one) for one in everybody))


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Two nodes on this machine, with a processor each."""
    from ray._private import ray_constants
    from ray.cluster_utils import Cluster

    for name, value in HERE_ONLY.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(ray_constants, "ENABLE_RAY_CLUSTER", False)
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    made.add_node(num_cpus=1)
    yield made
    made.shutdown()


def without_times(folder: Path) -> list[dict[str, str]]:
    return [{key: row[key] for key in row if not key.startswith("time/")} for row in read_rows(folder / METRICS)]


@needs_ray
@pytest.mark.soak
def test_training_on_two_nodes_is_that_in_two_processes(cluster: Any, tmp_path: Path):
    tables = []
    for engine in (("collect.engine=ray", f"collect.address={cluster.address}"), ("collect.engine=processes",)):
        folder = tmp_path / str(len(engine))
        command = [sys.executable, "train.py", *RUN, *engine, "refresh_every_frames=3000", f"run_dir={folder}"]
        ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=os.environ | HERE_ONLY)
        assert ended.returncode == 0, ended.stdout + ended.stderr
        summary = json.loads((folder / "summary.json").read_text())
        assert summary["frames"] >= 6000
        assert summary["episodes"] > 10
        assert summary["refreshes"] > 0
        tables.append(without_times(folder))
    assert tables[0] == tables[1]


def raylet(node: Any) -> int:
    [info] = node.all_processes["raylet"]
    pid: int = info.process.pid
    return pid


def actor(node: Any) -> int:
    """The worker that collects on a node."""
    found = [one for one in children_of(raylet(node)) if "Collector" in command_line_of(one)]
    assert len(found) == 1, "one worker to a node"
    return found[0]


FAULTS = {
    "worker": (lambda node: os.kill(actor(node), signal.SIGKILL), r"is lost: it has ended \(pid: \d+, ip: [\d.]+\)"),
    "node": (lambda node: os.kill(raylet(node), signal.SIGKILL), r"is lost: .*"),
    "hangs": (lambda node: os.kill(actor(node), signal.SIGSTOP), r"hangs: no batch for 5 s \(collect.timeout_s\)"),
}


@needs_ray
@pytest.mark.soak
@pytest.mark.parametrize("fault", FAULTS)
def test_a_lost_worker_over_ray_leaves_a_run_that_resumes(fault: str, cluster: Any, training: Any, tmp_path: Path):
    break_it, what = FAULTS[fault]
    run = training(f"collect.address={cluster.address}", "collect.timeout_s=5" if fault == "hangs" else "seed=0")
    [node] = cluster.worker_nodes
    hurt = time.monotonic()
    break_it(node)
    output, _ = run.communicate(timeout=240)
    assert time.monotonic() - hurt < 60
    assert run.returncode == 1, output
    assert "Traceback" not in output
    [line] = [line for line in output.splitlines() if line.startswith("error:")]
    kept = r"the run is saved as of ([\d,]+) frames, to go on: (.+)"
    found = re.fullmatch(rf"error: worker [01] of 2 \(over Ray\) {what}; {kept}", line)
    assert found, line
    frames = int(found[1].replace(",", ""))
    here = ["collect.engine=processes", "collect.address=null"]  # the cluster has lost a processor
    subprocess.run([*found[2].split(), *here, f"total_frames={frames + 1}"], cwd=ROOT, check=True, capture_output=True)
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["frames"] > frames


@needs_ray
@pytest.mark.soak
def test_a_cluster_that_is_too_small(cluster: Any):
    config = sizes(3)
    config.engine, config.address = "ray", cluster.address
    with pytest.raises(ConfigError, match=r"^collect\.processes=3: allowed is at most 2, the free processors"):
        make_collector(make_dqn(), ENV, config, LANDER_TASK, InstructorConfig(), seed=3)


BAD = {
    "breaks": (partial(int, "no game"), "ValueError: invalid literal"),
    "sleeps": (partial(time.sleep, 600), "they were not ready within 10 s"),
}


@needs_ray
@pytest.mark.soak
@pytest.mark.parametrize("factory", BAD)
def test_a_worker_over_ray_that_never_gets_ready(factory: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ray_workers, "START_S", 10.0 if factory == "sleeps" else 60.0)
    make, why = BAD[factory]
    with pytest.raises(LostWorkerError, match=f"^the workers could not be started: {why}"):
        RayWorkers([make], make_dqn().policy, 100, CollectConfig(engine="ray", timeout_s=1.0))


def test_the_first_error_of_a_traceback_says_what_was_wrong():
    text = "The actor died\n  File x\nray.exceptions.RaySystemError: System error: No module named 'a'\nKeyError: 3"
    assert ray_workers._first_error(text) == "RaySystemError: System error: No module named 'a'"
    assert ray_workers._first_error("it died\nof age") == "it died"
    assert ray_workers._first_error("") == "for an unknown reason"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (
            "died\n\tpid: 12\n\tip: 10.0.0.2\nits worker process has died",
            "is lost: it has ended (pid: 12, ip: 10.0.0.2)",
        ),
        (
            "The actor died because its node has died. Node Id: 1",
            "is lost: its machine is gone (The actor died because its node has died. Node Id: 1)",
        ),
    ],
)
def test_an_end_is_described_in_a_few_words(text: str, what: str):
    assert ray_workers._why(RuntimeError(text)) == what


def test_nobody_is_asked_as_long_as_nothing_has_gone_wrong():
    assert Actors([object(), object()]).dead() == []
