"""A sweep as it is asked for: what is refused, how a run is started, and the real thing, killed and taken up again."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from processes import ROOT, SMALL, call, gone, start
from view_data import eventually

from ibe_rl.agents.ppo import PPOConfig
from ibe_rl.apps.ray import workers as ray_workers
from ibe_rl.apps.sweep import launch as launching
from ibe_rl.apps.sweep.jobs import DONE, FAILED, NOT_BEGUN, Job, Outcome
from ibe_rl.apps.sweep.launch import command, elsewhere, how_many, launch, refuse
from ibe_rl.config.settings import (
    CollectConfig,
    EnvConfig,
    InstructorConfig,
    PredictorConfig,
    TrainConfig,
    ViewerConfig,
)
from ibe_rl.ibe import IBEConfig
from ibe_rl.instructors.human import HumanConfig
from ibe_rl.runtime.operating_system import children_of, command_line_of
from ibe_rl.storage.run_folder import read_rows
from ibe_rl.types import ConfigError

CFG = TrainConfig(
    run_dir="",
    env=EnvConfig(id="game"),
    agent=PPOConfig(),
    instructor=InstructorConfig(),
    mapping=IBEConfig(),
    predictor=PredictorConfig(),
    viewer=ViewerConfig(),
)


def test_what_cannot_work_in_a_sweep_is_refused_by_name() -> None:
    place = Path("runs/sweep")
    refuse(["seed=1"], CFG, place)
    with pytest.raises(ConfigError, match=r"^seed=-1: allowed is at least 0"):
        refuse([], replace(CFG, seed=-1), place)
    with pytest.raises(ConfigError, match=r"^resume=runs/old in a sweep: allowed is .* with run_dir=DIR"):
        refuse([], replace(CFG, resume="runs/old"), place)
    for given in ("viewer=live", "viewer.mode=live"):
        with pytest.raises(ConfigError, match=r"^viewer=live in a sweep: .*ibe_rl.viewer /\S+/runs/sweep` shows all"):
            refuse([given], CFG, place)
    refuse(["viewer=file"], replace(CFG, viewer=ViewerConfig("file")), place)
    with pytest.raises(ConfigError, match=r"^instructor=human in a sweep: .*hydra/launcher=basic"):
        refuse([], replace(CFG, instructor=HumanConfig()), place)


def test_a_sweep_on_a_cluster_is_told_where_and_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        there = replace(CFG, runs_on=f"127.0.0.1:{server.getsockname()[1]}", runs_at_once=3)
        monkeypatch.setattr(ray_workers, "find_spec", lambda _: None)
        with pytest.raises(ConfigError, match=r"^runs_on=127\.0\.0\.1:\d+: Ray is not installed .* allowed is null"):
            refuse([], there, Path("runs/sweep"))
        monkeypatch.setattr(ray_workers, "find_spec", lambda _: True)
        refuse([], there, Path("runs/sweep"))
        with pytest.raises(ConfigError, match=r"^runs_on=.*: allowed only with runs_at_once"):
            refuse([], replace(there, runs_at_once=None), Path("runs/sweep"))
    with pytest.raises(ConfigError, match=r"^runs_on=127\.0\.0\.1:\d+: allowed is host:port of a Ray cluster"):
        refuse([], there, Path("runs/sweep"))
    on = [sys.executable, "-m", "ibe_rl.apps.ray.run", there.runs_on, "2"]
    assert (elsewhere([there]), elsewhere([CFG])) == (on, [])


def test_every_run_has_a_core_for_each_of_its_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "usable_cores", lambda: 8)

    def of(processes: int, overlap: bool = False) -> TrainConfig:
        return replace(CFG, collect=CollectConfig(processes=processes, overlap=overlap))

    assert how_many([of(2)] * 9) == 4
    assert how_many([of(1)] * 9) == 8
    assert how_many([of(1)] * 3) == 3
    assert how_many([of(1), *[of(3, overlap=True)] * 8]) == 2
    assert how_many([of(64)] * 9) == 1
    assert how_many([replace(of(64), runs_at_once=5)] * 9) == 5


def test_a_run_is_started_alone_and_goes_on_with_the_settings_it_has() -> None:
    job = Job("seed=1", Path("runs/it's, mine"), ("seed=1", "run_dir=runs/all"), 10)
    begun = command(job, False, ["--config-name=train"], ["viewer=file"])
    assert begun[0] == sys.executable
    place, alone = r"'runs/it\'s, mine'", ["hydra.mode=RUN", "hydra.job.name='seed=1'"]
    assert begun[2:] == ["--config-name=train", "seed=1", "viewer=file", f"run_dir={place}", *alone]
    goes_on = command(job, True, ["--config-name=train"], ["viewer=file"])
    assert goes_on[2:] == ["--config-name=train", f"resume={place}", *alone]


@pytest.mark.parametrize(("became", "ends"), [(FAILED, SystemExit), (NOT_BEGUN, KeyboardInterrupt), (DONE, None)])
def test_how_a_sweep_ends(
    became: str,
    ends: type[BaseException] | None,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "0").mkdir()
    (tmp_path / "0" / "summary.json").write_text(json.dumps({"frames": 1, "success_rate": 1.0, "return_mean": 1.0}))
    monkeypatch.setattr(launching, "run_all", lambda jobs, *_: [Outcome(jobs[0], became, "error: broken")])
    monkeypatch.setenv("COLUMNS", "20")  # of which no word is left out
    if ends is None:
        launch(tmp_path, [["seed=1"]], [CFG], [])
    else:
        with pytest.raises(ends):
            launch(tmp_path, [["seed=1"]], [CFG], [])
    said = capsys.readouterr().out
    assert f"-m ibe_rl.viewer {tmp_path}\n" in said
    assert f"explain.py sweep={tmp_path}\n" in said
    assert "they are recorded, not served" in said
    assert all(word in said for word in ("run ", "frames", "success", "return", became))
    assert ("failed: 0: error: broken" in said) == (became == FAILED)
    assert ("resumes it" in said) == (became == NOT_BEGUN)


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["mapping.top_fraction=0.1,2"], "error: mapping.top_fraction=2.0: allowed is above 0 and at most 1"),
        (["seed=0,1", "viewer=live"], "error: viewer=live in a sweep: allowed is file or off"),
        (["resume=a,b"], "error: resume=a in a sweep: allowed is"),
        (["seed=0,1", "runs_at_once=0"], "error: runs_at_once=0: allowed is at least 1"),
    ],
)
def test_bad_sweeps_end_in_one_line_before_anything_is_started(
    overrides: list[str], expected: str, tmp_path: Path
) -> None:
    with pytest.raises(SystemExit) as stopped:
        call("train", "-m", *overrides, f"run_dir={tmp_path}")
    assert str(stopped.value.code).startswith(expected)
    assert "\n" not in str(stopped.value.code)
    assert [path.name for path in tmp_path.iterdir()] == ["multirun.yaml"]


def trainer_of(sweep: int, run: Path) -> int:
    """The process of train.py that trains there."""
    [pid] = [one for one in children_of(sweep) if f"run_dir='{run}'" in command_line_of(one)]
    return pid


def test_a_sweep_with_a_killed_run_goes_on_and_is_taken_up_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = tmp_path / "sweep"
    longer = ["total_frames=8000", "checkpoint_every_frames=1000", "refresh_every_frames=null", "eval_episodes=2"]
    asked = ["-m", "seed=0,1", *SMALL, *longer, "viewer=off", f"run_dir={sweep}"]
    script = start("train.py", *asked, "runs_at_once=2")
    killed, other = sweep / "1_seed=1", sweep / "0_seed=0"
    assert eventually(lambda: (killed / "checkpoints" / "latest.pt").exists())
    os.killpg(trainer_of(script.pid, killed), signal.SIGKILL)
    output, _ = script.communicate(timeout=200)
    assert script.returncode == 1, output
    assert "seed=1: failed: killed by SIGKILL" in output
    assert f"what it printed: {killed / 'output.log'}" in output
    assert "Traceback" not in output
    before = (other / "summary.json").stat().st_mtime_ns
    assert not (killed / "summary.json").exists()
    call("train", *asked)
    output = capsys.readouterr().out
    assert "seed=0: finished earlier" in output
    assert "seed=1: resumes at about" in output
    assert "resuming at" in (killed / "output.log").read_text()
    assert (other / "summary.json").stat().st_mtime_ns == before
    for run in (other, killed):
        assert json.loads((run / "summary.json").read_text())["frames"] == 8192
        assert [int(row["frames"]) for row in read_rows(run / "metrics.csv")] == [1024 * (i + 1) for i in range(8)]
    assert not (ROOT / "multirun.yaml").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_a_terminal_or_a_batch_system_sends_ends_a_sweep_in_order(number: int, tmp_path: Path) -> None:
    asked = ["-m", "seed=0,1", *SMALL, "total_frames=100000000", "viewer=off", f"run_dir={tmp_path}", "runs_at_once=1"]
    script = start("train.py", *asked)
    assert eventually(lambda: (tmp_path / "0_seed=0" / "checkpoints" / "latest.pt").exists())
    if number == signal.SIGTERM:
        os.kill(trainer_of(script.pid, tmp_path / "0_seed=0"), number)  # batch systems reach every process
    os.killpg(script.pid, number)
    output, _ = script.communicate(timeout=240)
    assert script.returncode == 130, output
    assert json.loads((tmp_path / "0_seed=0" / "summary.json").read_text())["stopped_early"] is True
    assert not (tmp_path / "1_seed=1").exists()
    assert "seed=0: stopped" in output
    assert f"the same command with run_dir={tmp_path} resumes it" in output
    assert "Traceback" not in output


def test_no_run_outlives_a_sweep_that_is_killed(tmp_path: Path) -> None:
    asked = ["-m", "seed=0,1", *SMALL, "total_frames=100000000", "viewer=off", f"run_dir={tmp_path}", "runs_at_once=1"]
    script, run = start("train.py", *asked), tmp_path / "0_seed=0"
    assert eventually(lambda: (run / "metrics.csv").exists())
    trainer = trainer_of(script.pid, run)
    os.kill(script.pid, signal.SIGKILL)
    script.communicate(timeout=240)
    assert eventually(lambda: gone(trainer))
    assert not (run / "summary.json").exists()
    assert (run / "checkpoints" / "latest.pt").exists()
