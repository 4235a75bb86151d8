"""What can go wrong in the middle of a real training: nothing logged is lost, and one line says what to do."""

from __future__ import annotations

import csv
import json
import os
import re
import resource
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from processes import SMALL, call
from view_data import read

import train
from ibe_rl.agents import dqn, ppo
from ibe_rl.runtime.installation import pasted
from ibe_rl.storage.checkpoint import load
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import create_run_folder
from ibe_rl.training import build
from ibe_rl.training.failure import how_to_go_on
from ibe_rl.vocabulary.tracker import VocabularyTracker

RUN = [*SMALL, "eval_every_frames=2000", "checkpoint_every_frames=1000", "viewer=off"]
FRAMES = [1024 * (i + 1) for i in range(6)]
ON = "stop_after_frames=null"
ROOM = 100_000
"""Bytes of the longest file: settings, metrics and vocabularies are shorter, states and the log's states longer."""
Setter = pytest.MonkeyPatch
Output = pytest.CaptureFixture[str]


def failing(*arguments: str) -> str:
    """Run train.py, which has to end in one line; returns it."""
    with pytest.raises(SystemExit) as ended:
        call("train", *arguments)
    said = str(ended.value.code)
    assert said.startswith("error: ")
    assert "\n" not in said
    return said


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "metrics.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def frames_of(folder: Path) -> list[int]:
    return [int(row["frames"]) for row in rows(folder)]


def state_frames(folder: Path, name: str = "latest") -> int:
    return int(load(folder / "checkpoints" / f"{name}.pt")["frames"])


def assert_all_there(folder: Path) -> None:
    """As if nothing had happened."""
    assert frames_of(folder) == FRAMES
    assert json.loads((folder / "summary.json").read_text())["frames"] == FRAMES[-1]
    log = TrajectoryLog.open(folder / "trajectories")
    assert log.frames == FRAMES[-1]
    assert len(log.read(range(len(log.index)))) == log.episodes_ended > 30
    assert not list(folder.rglob("*.partial"))


@contextmanager
def full_disk(room: int) -> Iterator[None]:
    """No file grows beyond so many bytes in here."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def at_frames(monkeypatch: Setter, frames: int, do: Callable[[Any], None]) -> None:
    """Do something in the middle of a training, after the row of a batch was made."""
    real = train.training_row

    def row(log: TrajectoryLog, losses: dict[str, float]) -> dict[str, float]:
        if log.frames == frames:
            do(log)
        return real(log, losses)

    monkeypatch.setattr(train, "training_row", row)


def limit(room: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def test_the_disk_is_full_when_the_state_is_written(tmp_path: Path, monkeypatch: Setter, capsys: Output) -> None:
    folder = tmp_path / "run"
    at_frames(monkeypatch, 4096, lambda _: limit(ROOM))
    with full_disk(resource.RLIM_INFINITY):
        said = failing(*RUN, f"run_dir={folder}")
    assert f"{folder}/checkpoints/latest.pt cannot be written (File too large)" in said
    assert "the training has ended at 4,096 frames; make room, then resume its saved state of 3,072 frames" in said
    assert said.endswith(f": {pasted('train', f'resume={folder}')}")
    assert state_frames(folder) == 3072
    assert frames_of(folder) == FRAMES[:4]
    assert not list(folder.rglob("*.partial"))
    monkeypatch.undo()
    call("train", f"resume={folder}")
    assert "resuming at 3,072 frames" in capsys.readouterr().out
    assert_all_there(folder)


def test_the_disk_is_full_when_metrics_are_written(tmp_path: Path, monkeypatch: Setter) -> None:
    folder = tmp_path / "run"
    at_frames(monkeypatch, 4096, lambda _: limit((folder / "metrics.csv").stat().st_size + 40))
    with full_disk(resource.RLIM_INFINITY):
        said = failing(*RUN, "refresh_every_frames=null", "eval_every_frames=10000", f"run_dir={folder}")
    assert f"{folder}/metrics.csv cannot be written (File too large), the training has ended at 4,096 frames" in said
    assert frames_of(folder) == FRAMES[:3]
    assert (folder / "metrics.csv").read_bytes().endswith(b"\r\n")  # no part of a row
    monkeypatch.undo()
    call("train", f"resume={folder}")
    assert_all_there(folder)


def test_the_disk_has_no_room_for_the_log(tmp_path: Path) -> None:
    """It is known before the first episode is written, and not by being killed in the middle."""
    folder = tmp_path / "run"
    with full_disk(ROOM):
        said = failing(*RUN, f"run_dir={folder}")
    assert f"{folder}/trajectories/state.npy cannot be written (File too large)" in said
    assert said.endswith(f"make room, then resume its saved state of 0 frames: {pasted('train', f'resume={folder}')}")
    assert not (folder / "trajectories" / "state.npy").exists()
    call("train", f"resume={folder}")
    assert_all_there(folder)


def test_a_run_folder_that_is_deleted(tmp_path: Path, monkeypatch: Setter) -> None:
    folder = tmp_path / "run"
    at_frames(monkeypatch, 2048, lambda _: shutil.rmtree(folder))
    said = failing(*RUN, "total_frames=4000", f"run_dir={folder}")
    assert f"run_dir={folder}: it was moved or deleted, the training has ended at 2,048 frames; allowed is" in said
    assert not folder.exists()


def test_a_training_without_a_name_goes_beside_one_of_the_same_second(tmp_path: Path, monkeypatch: Setter) -> None:
    folder = create_run_folder(tmp_path / "now")
    monkeypatch.setattr(build, "output_folder", lambda _: folder)
    call("train", *RUN, "total_frames=1000", "refresh_every_frames=null", "eval_episodes=1")
    config = yaml.safe_load((tmp_path / "now_2/.hydra/config.yaml").read_text())
    assert config["run_dir"] == str(tmp_path / "now_2")
    assert frames_of(tmp_path / "now_2") == FRAMES[:1]
    monkeypatch.undo()
    assert failing(*RUN, "run_dir=") == "error: run_dir=: allowed is the name of a folder, or a dot for this one"


def test_a_part_of_a_run_folder_that_is_deleted(tmp_path: Path, monkeypatch: Setter) -> None:
    folder = tmp_path / "run"
    at_frames(monkeypatch, 2048, lambda _: shutil.rmtree(folder / "checkpoints"))
    said = failing(*RUN, "total_frames=4000", "refresh_every_frames=null", f"run_dir={folder}")
    assert f"{folder}/checkpoints/policy_000000002048.pt cannot be written (No such file or directory)" in said
    assert said.endswith("at 2,048 frames; let it be written, then train again: no state was saved")
    assert TrajectoryLog.open(folder / "trajectories").frames == 2048


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was stopped in the middle; never changed."""
    folder = tmp_path_factory.mktemp("stopped") / "run"
    call("train", *RUN, "stop_after_frames=4000", f"run_dir={folder}")
    return folder


@pytest.fixture
def run(stopped: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stopped, tmp_path / "run"))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def test_a_checkpoint_that_was_cut_short(run: Path) -> None:
    best = run / "checkpoints/best.pt"
    shutil.copy(best, run / "kept.pt")
    cut(run / "checkpoints/latest.pt")
    (run / "kept.pt").replace(best)  # they may be one and the same
    said = failing(f"resume={run}")
    assert f"{run}/checkpoints/latest.pt: not a readable checkpoint" in said
    assert said.endswith("allowed is resume_from=best (best.pt)")
    call("train", f"resume={run}", "resume_from=best", ON)
    assert_all_there(run)


def test_all_checkpoints_were_cut_short(run: Path) -> None:
    for name in ("latest", "best"):
        cut(run / f"checkpoints/{name}.pt")
    for name in ("latest", "best"):
        said = failing(f"resume={run}", f"resume_from={name}")
        assert f"{name}.pt: not a readable checkpoint" in said
    assert said.endswith("train again")
    assert frames_of(run) == FRAMES[:4]  # nothing was touched


@pytest.mark.parametrize("damage", [cut, Path.unlink], ids=["cut", "missing"])
@pytest.mark.parametrize("name", ["number", "state", "given"])
def test_a_log_that_was_cut_short(run: Path, name: str, damage: Callable[[Path], None]) -> None:
    damage(run / f"trajectories/{name}.npy")
    said = failing(f"resume={run}")
    assert f"resume={run}: {run}/trajectories is not a readable log: {name}.npy is not a readable array" in said
    assert (
        f"put the file back from a copy, or move {run}/trajectories out of the way to go on with an empty log" in said
    )


def test_a_run_goes_on_with_an_empty_log(run: Path) -> None:
    (run / "trajectories").rename(run / "damaged")
    call("train", f"resume={run}", ON)
    assert frames_of(run) == FRAMES
    log = TrajectoryLog.open(run / "trajectories")
    assert log.frames == FRAMES[-1]
    before = TrajectoryLog.open(run / "damaged").episodes_ended
    assert log.index["number"].tolist() == list(range(before, log.episodes_ended))
    log.read(range(len(log.index)))


def test_the_index_of_a_log_that_was_cut_short_is_made_again(run: Path) -> None:
    cut(run / "trajectories/episodes.npy")
    call("train", f"resume={run}", ON)
    assert_all_there(run)


class Once:
    """Fails at its second call."""

    def __init__(self, real: Callable[..., Any]):
        self.real, self.calls = real, 0

    def __get__(self, owner: Any, _: type) -> Callable[..., Any]:
        return lambda *arguments: self(owner, *arguments)

    def __call__(self, *arguments: Any) -> Any:
        self.calls += 1
        if self.calls == 2:
            raise np.linalg.LinAlgError("SVD did\nnot converge")
        return self.real(*arguments)


@pytest.mark.parametrize("where", ["refresh", "save"])
def test_a_refresh_that_throws(where: str, tmp_path: Path, monkeypatch: Setter, capsys: Output) -> None:
    """The run goes on with the vocabulary before, and says so."""
    folder = tmp_path / "run"
    monkeypatch.setattr(VocabularyTracker, where, Once(getattr(VocabularyTracker, where)))
    call("train", *RUN, "viewer=file", f"run_dir={folder}")
    said = capsys.readouterr().out
    details = folder / "refreshes/failed_000000004096.txt"
    reason = f"it failed (LinAlgError: SVD did not converge), the details are in {details}"
    assert f"refresh skipped at 4,096 frames: {reason}" in said
    assert "Once" not in said
    assert "Traceback" in details.read_text()
    assert_all_there(folder)
    assert sorted(path.name for path in folder.glob("refreshes/*.json")) == ["000000002048.json", "000000006144.json"]
    last = json.loads((folder / "refreshes/000000006144.json").read_text())
    assert last["change"]["since_frame"] == 2048  # the one before stayed
    summary = json.loads((folder / "summary.json").read_text())
    assert [summary["refreshes"], summary["refreshes_skipped"]] == [2, 1]
    assert [row["ibe/skipped"] for row in rows(folder) if row["ibe/skipped"]] == ["1"]
    lines = [text for row in read(folder / "recording.rrd")["/log"] for text in row["TextLog:text"] or []]
    assert any(reason in line for line in lines)


def spoil(monkeypatch: Setter, module: Any, batches: int) -> None:
    """Let the rewards that the agent learns from be no numbers from some batch on."""
    real, calls = module.learning_reward, []

    def reward(batch: Any, config: Any) -> Any:
        calls.append(batch)
        return real(batch, config) * (float("nan") if len(calls) > batches else 1)

    monkeypatch.setattr(module, "learning_reward", reward)


@pytest.mark.parametrize(("agent", "module", "loss"), [("ppo", ppo, "policy_loss"), ("dqn", dqn, "q_loss")])
def test_a_loss_that_is_no_number(agent: str, module: Any, loss: str, tmp_path: Path, monkeypatch: Setter) -> None:
    folder = tmp_path / "run"
    settings = ["agent.learn_after_frames=0", "agent.buffer_frames=10000"] if agent == "dqn" else []
    spoil(monkeypatch, module, batches=4)
    said = failing(*RUN, f"agent={agent}", *settings, f"run_dir={folder}")
    assert f"learning from the frames after 4,096 gave {loss}=nan, the training has ended" in said
    assert f"resume its saved state of 4,096 frames: {pasted('train', f'resume={folder}')} with a smaller" in said
    assert frames_of(folder) == FRAMES[:4]
    assert TrajectoryLog.open(folder / "trajectories").frames == 4096
    for path in folder.glob("checkpoints/policy_*.pt"):
        assert all(torch.isfinite(value).all() for value in load(path).values())
    monkeypatch.undo()
    call("train", f"resume={folder}", "agent.learning_rate=0.0001")
    assert_all_there(folder)


def test_without_a_state_there_is_none_to_go_on_from(tmp_path: Path) -> None:
    assert how_to_go_on(tmp_path) == "train again: no state was saved"


def test_an_error_that_nobody_expects_keeps_what_was_logged(tmp_path: Path, monkeypatch: Setter) -> None:
    folder = tmp_path / "run"

    def fail(_: Any) -> None:
        raise ZeroDivisionError("a bug")

    at_frames(monkeypatch, 4096, fail)
    with pytest.raises(ZeroDivisionError) as raised:
        call("train", *RUN, f"run_dir={folder}")
    again = pasted("train", f"resume={folder}")
    note = f"What was logged is in {folder}; resume its saved state of 3,072 frames: {again}"
    assert raised.value.__notes__ == [note]
    assert TrajectoryLog.open(folder / "trajectories").frames == 4096
    monkeypatch.undo()
    call("train", f"resume={folder}")
    assert_all_there(folder)


def edit(run: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    path = run / ".hydra/config.yaml"
    config = yaml.safe_load(path.read_text())
    change(config)
    path.write_text(yaml.safe_dump(config))


def test_settings_of_an_older_version_that_are_no_more(run: Path) -> None:
    edit(run, lambda config: config["mapping"].update(clusters=8))
    said = failing(f"resume={run}")
    assert f"{run}/.hydra/config.yaml: not the config of a run of this version of ibe_rl (" in said
    assert "mapping.clusters: no such setting; allowed are kind, horizon_steps," in said


def test_settings_that_an_older_version_did_not_have_are_the_defaults(run: Path) -> None:
    edit(run, lambda config: [config.pop("checkpoint_every_frames"), config["mapping"].pop("hold_within")])
    call("train", f"resume={run}", ON)
    assert_all_there(run)


def test_a_state_of_an_older_version(run: Path) -> None:
    path = run / "checkpoints/latest.pt"
    torch.save({"agent": load(path)["agent"], "frames": 4096}, path)
    said = failing(f"resume={run}")
    assert f"{path}: not a state of this version of ibe_rl to resume from; allowed is resume_from=best" in said


def test_a_state_of_another_network(run: Path) -> None:
    edit(run, lambda config: config["agent"].update(hidden=[17]))
    said = failing(f"resume={run}")
    assert f"resume={run}: its state does not fit this version of ibe_rl or its own settings (RuntimeError: " in said


def test_a_run_from_before_there_were_states(run: Path) -> None:
    shutil.rmtree(run / "checkpoints")
    said = failing(f"resume={run}")
    assert "it has no checkpoints/latest.pt, it ended before the first one; train again" in said


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Nothing in the folder can be written in here, not even by root, who is somebody else for the time."""
    for path in [folder, *folder.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    who = os.geteuid()
    if who == 0:
        os.seteuid(65534)
    try:
        assert not os.access(folder, os.W_OK, effective_ids=True)
        yield
    finally:
        os.seteuid(who)
        for path in [folder, *folder.rglob("*")]:
            path.chmod(0o755 if path.is_dir() else 0o644)


def test_a_folder_that_can_only_be_read(stopped: Path, capsys: Output) -> None:
    with tempfile.TemporaryDirectory() as place:  # others may not look into pytest's folders
        Path(place).chmod(0o755)
        run = Path(shutil.copytree(stopped, Path(place) / "run"))
        before = {path: path.stat().st_mtime_ns for path in run.rglob("*")}
        call("explain", f"run={run}", "viewer=off")  # imports all that it needs: others may not read these libraries
        with read_only(run):
            said = failing(f"resume={run}")
            assert said == f"error: run_dir={run}: allowed is a folder that can be written to (Permission denied)"
            call("explain", f"run={run}", "viewer=off")  # which needs no more
            assert "went as predicted" in capsys.readouterr().out
            with pytest.raises(SystemExit, match=r"error: output=.*: allowed is a file that can be written"):
                call("explain", f"run={run}", "viewer=file")
        assert before == {path: path.stat().st_mtime_ns for path in run.rglob("*")}


@pytest.mark.parametrize("place", ["/proc/run", "/proc/self/status/run"])
def test_a_place_where_no_folder_can_be(place: str) -> None:
    said = failing(*RUN, f"run_dir={place}")
    assert re.match(rf"error: run_dir={place}: allowed is a folder that can be written to \(.+\)", said)
