"""Recorded runs compared value by value: hand-made folders, and scripts that take no time."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import torch
from PIL import Image

from benchmarks.same_facts import files
from benchmarks.same_numbers import compare, differences, main
from benchmarks.same_runs import ABOUT, CATALOGUE, OUTPUT, record

RUN = "ppo_lander"


PRINTED = """100% 900 frames/s
 the run in numbers
┏━━━━━━┳━━━┓
│ wall_s │ 7 │
└──────┴───┘
kept in {run}
  open: ../.venv/bin/python explain.py
"""
SLOWER = {"900": "90", "│ 7 │": "│ 10.5 │", "━┳━━━": "━━┳━━━━━━", "─┴───": "──┴──────", " the run": "    the run"}


def write_recording(path: Path, last: float) -> None:
    stream = rr.RecordingStream("a test")
    stream.save(path)
    for frame, value in enumerate((1.0, float("nan"), last)):
        stream.set_time("frames", sequence=frame)
        stream.log("curves/return", rr.Scalars(value))
    stream.disconnect()


def write_run(folder: Path) -> None:
    run = folder / RUN
    for name in (".hydra", "refreshes", "trajectories", "checkpoints", "figures", "1_seed=1"):
        (run / name).mkdir(parents=True)
    (folder / ABOUT).write_text(json.dumps({"folder": str(folder), "checkout": "/a/checkout"}))
    (run / ".hydra" / "config.yaml").write_text(f"seed: 0\nrun_dir: {run}\nmapping: {{n_clusters: 8}}\n")
    (run / "metrics.csv").write_text("frames,train/loss,time/learn\n10,0.5,0.125\n20,nan,0.25\n")
    (run / "1_seed=1" / "metrics.csv").write_text("frames,time/learn\n10,0.5\n")
    (run / "summary.json").write_text(
        '{"frames": 20, "wall_s": 1.5, "time_s": {"learn": 1}, "versions": {"torch": "2"}}'
    )
    (run / "refreshes" / "20.json").write_text('{"clusters": [{"id": 0, "empty": []}, {"id": 1}]}')
    np.savez(run / "refreshes" / "probe.npz", delta=np.array([[1.0, np.nan]]))
    np.save(run / "trajectories" / "state.npy", np.arange(6.0).reshape(2, 3))
    buffer = {"_len": 2, "_storage": {"reward": torch.tensor([1.0, 2.0, 7.0])}}  # the last was never written
    state = {"agent": {"w": torch.tensor([1.0, 2.0]), "buffer": {"_storage": buffer}}, "shown": (4, 5)}
    state |= {"counts": {"wall_s": 3.0, "kept": 1}, "random": {"numpy": ("MT19937", torch.tensor([3]), 624)}}
    torch.save(state, run / "checkpoints" / "latest.pt")
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(run / "figures" / "one.png")
    (run / "figures" / "report.html").write_text("<p>one</p>\n<p>two</p>\n")
    (run / OUTPUT).write_text(PRINTED.format(run=run))
    shutil.copy(run / OUTPUT, run / "1_seed=1" / "output.log")
    write_recording(run / "recording.rrd", 3.0)


@pytest.fixture
def before(tmp_path: Path) -> Path:
    write_run(tmp_path / "before")
    return tmp_path / "before"


@pytest.fixture
def after(before: Path, tmp_path: Path) -> Path:
    """The same numbers at another time, in another place."""
    folder = Path(shutil.copytree(before, tmp_path / "somewhere" / "after"))
    (folder / ABOUT).write_text(json.dumps({"folder": str(folder), "checkout": "/another"}))
    run = folder / RUN
    edit(run / ".hydra" / "config.yaml", str(before), str(folder))
    edit(run / "metrics.csv", "0.125", "0.0625")
    edit(run / "1_seed=1" / "metrics.csv", "0.5", "0.75")
    edit(run / "summary.json", '"wall_s": 1.5, "time_s": {"learn": 1}', '"wall_s": 9, "time_s": {"learn": 2}')
    for printed in (run / OUTPUT, run / "1_seed=1" / "output.log"):
        for old, new in (SLOWER | {str(before): str(folder), "../.venv": "/usr"}).items():
            edit(printed, old, new)
    state = torch.load(run / "checkpoints" / "latest.pt", weights_only=True)
    state["counts"]["wall_s"] = 4.0
    state["random"]["numpy"] = ("MT19937", torch.tensor([4]), 624)
    state["agent"]["buffer"]["_storage"]["_storage"]["reward"][2] = 8.0
    torch.save(state, run / "checkpoints" / "latest.pt")
    write_recording(run / "recording.rrd", 3.0)
    return folder


def edit(path: Path, old: str, new: str) -> None:
    said = path.read_text()
    assert old in said
    path.write_text(said.replace(old, new))


def test_what_only_took_another_time_in_another_place_is_equal(
    before: Path, after: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(before), str(after)]) == 0
    said = capsys.readouterr().out
    assert "| ppo_lander | refreshes | equal |  |" in said
    assert said.count("difference") == 1  # in the head of the table


def change_tensor(run: Path) -> None:
    state = torch.load(run / "checkpoints" / "latest.pt", weights_only=True)
    state["agent"]["w"][1] = 2.5
    torch.save(state, run / "checkpoints" / "latest.pt")


CHANGES: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "metrics": (
        lambda run: edit(run / "metrics.csv", "0.5", "0.5000001"),
        "metrics.csv",
        "metrics.csv: row 0 train/loss: 0.5 → 0.5000001",
    ),
    "summary": (
        lambda run: edit(run / "summary.json", '"frames": 20', '"frames": 20.0'),
        "summary.json",
        "summary.json: frames: 20 → 20.0",
    ),
    "setting": (
        lambda run: edit(run / ".hydra" / "config.yaml", "n_clusters: 8", "n_clusters: 9"),
        ".hydra",
        ".hydra/config.yaml: mapping/n_clusters: 8 → 9",
    ),
    "refresh": (
        lambda run: edit(run / "refreshes" / "20.json", '{"id": 1}', '{"id": 2}'),
        "refreshes",
        "refreshes/20.json: clusters/1/id: 1 → 2",
    ),
    "probe": (
        lambda run: np.savez(run / "refreshes" / "probe.npz", delta=np.array([[2.0, np.nan]])),
        "refreshes",
        "refreshes/probe.npz: delta: 1 of 2 values, first [0, 0]: 1.0 → 2.0",
    ),
    "trajectory": (
        lambda run: np.save(run / "trajectories" / "state.npy", np.zeros((1, 3))),
        "trajectories",
        "trajectories/state.npy: array: float64 (2, 3) → float64 (1, 3)",
    ),
    "checkpoint": (change_tensor, "checkpoints", "checkpoints/latest.pt: agent/w: 1 of 2 values, first [1]: 2.0 → 2.5"),
    "picture": (
        lambda run: Image.fromarray(np.eye(2, dtype=np.uint8)).save(run / "figures" / "one.png"),
        "figures",
        "figures/one.png: pixels: uint8 (2, 2, 3) → uint8 (2, 2)",
    ),
    "text": (
        lambda run: edit(run / "figures" / "report.html", "<p>two</p>\n", ""),
        "figures",
        "figures/report.html: line 1: <p>two</p> → nothing",
    ),
    "terminal": (
        lambda run: edit(run / OUTPUT, "kept", "put"),
        "terminal",
        "output.txt: line 3: kept in FOLDER/ppo_lander → put in FOLDER/ppo_lander",
    ),
    "recording": (
        lambda run: write_recording(run / "recording.rrd", 4.0),
        "recording.rrd",
        "recording.rrd: /curves/return Scalars:scalars 2: ({'frames': 2}, [3.0]) → ({'frames': 2}, [4.0])",
    ),
    "missing": (
        lambda run: (run / "refreshes" / "20.json").unlink(),
        "refreshes",
        "refreshes/20.json: only before",
    ),
}


@pytest.mark.parametrize("case", CHANGES)
def test_one_change_is_named(case: str, before: Path, after: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, what, words = CHANGES[case]
    change(after / RUN)
    rows = compare(before, after)
    assert [(row[1], row[2]) for row in rows if row[2]] == [(what, [words])]
    assert main(["compare", str(before), str(after)]) == 1
    assert f"| ppo_lander | {what} | 1 difference | {words} |" in capsys.readouterr().out


def test_a_run_that_is_missing_differs_unless_only_others_are_asked_for(before: Path, after: Path) -> None:
    for folder in (before, after):
        shutil.copytree(folder / RUN, folder / "demo")
    shutil.rmtree(after / RUN)
    rows = compare(before, after)
    assert all(bool(found) == (run == RUN) for run, _, found in rows)
    assert compare(before, after, ["demo"]) == [row for row in rows if row[0] == "demo"]


def test_of_long_texts_the_place_that_differs_is_shown() -> None:
    [said] = differences({"one": "x" * 300 + "a"}, {"one": "x" * 300 + "b"})
    assert said == f"one: …{'x' * 50}a → …{'x' * 50}b"


def test_a_folder_that_was_not_recorded_is_refused(before: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"AFTER=.*: allowed is a folder that `record` wrote"):
        compare(before, tmp_path)


SCRIPT = """
import sys
from pathlib import Path
settings = dict(one.split("=", 1) for one in sys.argv[1:] if "=" in one)
run = Path(settings.get("run_dir") or settings.get("run"))
run.mkdir(exist_ok=True)
(run / "{name}.json").write_text("[1]")
print("ran in", Path.cwd(), "for", run)
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "checkout"
    folder.mkdir()
    for name in ("train", "explain"):
        (folder / f"{name}.py").write_text(SCRIPT.format(name=name))
    return folder


def test_a_recording_runs_the_scripts_of_the_checkout(checkout: Path, tmp_path: Path) -> None:
    folder = tmp_path / "recorded"
    assert main(["record", str(checkout), str(folder), "--only", "episode"]) == 0
    assert {path.name for path in folder.iterdir()} == {ABOUT, RUN, "episode"}  # the first run, which it needs, too
    assert set(files(folder, "episode")) == {"train.json", "explain.json", OUTPUT}
    assert files(folder, "episode")[OUTPUT] == {"line 0": "ran in CHECKOUT for FOLDER/episode"}


def test_a_script_that_fails_is_reported(checkout: Path, tmp_path: Path) -> None:
    (checkout / "train.py").write_text("raise SystemExit('no')")
    with pytest.raises(RuntimeError, match=r"(?s)train.py .* ended with 1:\nno"):
        record(checkout, tmp_path / "recorded", [RUN], say=len)


def test_what_cannot_be_recorded_is_refused(checkout: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="--only walk: allowed are ppo_lander, "):
        record(checkout, tmp_path, ["walk"])
    with pytest.raises(ValueError, match=r"CHECKOUT=.*: allowed is a folder with train.py"):
        record(tmp_path, tmp_path)
    (tmp_path / "dqn_lander").mkdir()
    with pytest.raises(ValueError, match=r"FOLDER=.*: holds dqn_lander already"):
        record(checkout, tmp_path, ["dqn_lander"])


def test_each_copied_run_is_there_before() -> None:
    names = list(CATALOGUE)
    assert all(names.index(run.copied) < names.index(name) for name, run in CATALOGUE.items() if run.copied)
