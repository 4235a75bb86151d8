"""Nothing is lost while writing, nothing is written over, and the newest run is found."""

import csv
import errno
import fcntl
import json
import os
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from ibe_rl.storage.folder_lock import hold_folder
from ibe_rl.storage.run_folder import (
    CHECKPOINTS,
    CONFIG,
    METRICS,
    RECORDING,
    REFRESHES,
    SUMMARY,
    TRAJECTORIES,
    MetricsTable,
    create_run_folder,
    find_run,
    is_run,
    read_rows,
    write_atomically,
    write_json,
    write_rows,
)
from ibe_rl.types import ConfigError


def test_a_write_that_fails_leaves_the_file_as_it_was(tmp_path: Path):
    path = tmp_path / "file"
    write_atomically(path, lambda stream: stream.write(b"old"))

    def half(stream: BinaryIO) -> None:
        stream.write(b"ne")
        assert path.read_bytes() == b"old"  # nobody sees half a file
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, half)
    assert path.read_bytes() == b"old"
    write_atomically(path, lambda stream: stream.write(b"new"))
    assert [file.name for file in tmp_path.iterdir()] == ["file"]
    assert path.read_bytes() == b"new"


def test_json_is_readable_and_holds_numbers_only(tmp_path: Path):
    path = tmp_path / "file.json"
    write_json(path, {"a": 1, "b": [1.5, None]})
    assert json.loads(path.read_text()) == {"a": 1, "b": [1.5, None]}
    assert len(path.read_text().splitlines()) > 3
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text())["a"] == 1


def test_a_new_run_has_its_folders(tmp_path: Path):
    folder = create_run_folder(tmp_path / "runs" / "new")
    for name in (CHECKPOINTS, TRAJECTORIES, REFRESHES, ".hydra"):
        assert (folder / name).is_dir()
    assert is_run(folder)
    assert not is_run(tmp_path)


def test_a_folder_with_something_else_in_it_may_become_a_run(tmp_path: Path):
    (tmp_path / "notes.txt").write_text("mine")
    create_run_folder(tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", [METRICS, SUMMARY, RECORDING, CONFIG])
def test_a_run_is_not_written_over(tmp_path: Path, name: str):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("logged")
    with pytest.raises(ConfigError, match=f"run_dir={tmp_path}: holds a run already.* a new folder"):
        create_run_folder(tmp_path)
    assert path.read_text() == "logged"


@pytest.mark.parametrize("name", ["file", "file/run", "x" * 300], ids=["a file", "below a file", "too long"])
def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path, name: str):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ConfigError, match=r"run_dir=.*: allowed is a folder that can be written to \("):
        create_run_folder(tmp_path / name)


def test_a_run_is_found_by_its_path(tmp_path: Path):
    create_run_folder(tmp_path / "a")
    assert find_run(str(tmp_path / "a"), tmp_path / "nowhere") == tmp_path / "a"
    for other in (tmp_path, tmp_path / "none"):
        with pytest.raises(ConfigError, match=f"run={other}: not a run folder"):
            find_run(str(other), tmp_path)


def test_without_a_path_it_is_the_newest(tmp_path: Path):
    for age, name in enumerate(["a", "sweep/0_seed=0", "sweep/1_seed=1", "z"]):
        config = create_run_folder(tmp_path / name) / CONFIG
        os.utime(config, (1000 - age, 1000 - age))
    assert find_run(None, tmp_path) == tmp_path / "a"
    os.utime(tmp_path / "sweep/1_seed=1" / CONFIG, (2000, 2000))
    assert find_run(None, tmp_path) == tmp_path / "sweep/1_seed=1"


def test_of_several_those_that_fit_come_first(tmp_path: Path):
    for age, name in enumerate(["new", "middle", "old"]):
        config = create_run_folder(tmp_path / name) / CONFIG
        os.utime(config, (1000 - age, 1000 - age))
    assert find_run(None, tmp_path, lambda path: path.name != "new") == tmp_path / "middle"
    assert find_run(None, tmp_path, lambda _: False) == tmp_path / "new"


@pytest.mark.parametrize("below", [".", "missing"])
def test_without_any_run_it_says_so(tmp_path: Path, below: str):
    with pytest.raises(ConfigError, match=r"run=null: there is no run below .*; train one, or name one with run=DIR"):
        find_run(None, tmp_path / below)


def rows(path: Path) -> list[dict[str, Any]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_metrics_are_on_disk_row_by_row(tmp_path: Path):
    path = tmp_path / METRICS
    with MetricsTable(path, later=("eval/x", "frames")) as table:
        table.write({"frames": 100, "train/y": 0.123456789})
        assert rows(path) == [{"frames": "100", "train/y": "0.123457", "eval/x": ""}]
        table.write({"frames": 200, "train/y": float("nan"), "eval/x": np.float64(1e-9)})
        assert rows(path)[1] == {"frames": "200", "train/y": "", "eval/x": "1e-09"}
        table.write({"frames": 10**9})
    assert rows(path)[2] == {"frames": "1000000000", "train/y": "", "eval/x": ""}
    assert path.read_text().splitlines()[0] == "frames,train/y,eval/x"


def test_metrics_take_no_new_column(tmp_path: Path):
    with MetricsTable(tmp_path / METRICS) as table:
        table.write({"frames": 100})
        with pytest.raises(ValueError, match="new"):
            table.write({"frames": 200, "new": 1})
    assert len(rows(tmp_path / METRICS)) == 1


def test_metrics_go_on_behind_the_rows_up_to_there(tmp_path: Path):
    path = tmp_path / METRICS
    with MetricsTable(path, later=["eval/x"]) as table:
        for frames in (100, 200, 300):
            table.write({"frames": frames, "old": 1})
    with MetricsTable(path, later=["eval/x"], until_frames=200) as table:
        assert len(rows(path)) == 3  # nothing is lost before there is something new
        table.write({"frames": 300, "new": 2, "eval/x": 3})
    assert rows(path) == [
        {"frames": "100", "new": "", "eval/x": "", "old": "1"},
        {"frames": "200", "new": "", "eval/x": "", "old": "1"},
        {"frames": "300", "new": "2", "eval/x": "3", "old": ""},
    ]


def test_rows_after_some_frames_are_read_and_written(tmp_path: Path):
    with MetricsTable(tmp_path / METRICS) as table:
        for frames in (100, 200, 300):
            table.write({"frames": frames})
    assert [row["frames"] for row in read_rows(tmp_path / METRICS, above_frames=100)] == ["200", "300"]
    write_rows(tmp_path / "other.csv", read_rows(tmp_path / METRICS, above_frames=100, until_frames=200))
    assert rows(tmp_path / "other.csv") == [{"frames": "200"}]


@pytest.mark.parametrize("text", [None, "frames\nmany\n", "steps\n100\n", "frames\n\0\n"])
def test_a_table_that_is_none_is_refused(text: str | None, tmp_path: Path):
    if text is not None:
        (tmp_path / METRICS).write_text(text)
    with pytest.raises(ConfigError, match="not the readable table of a run"):
        read_rows(tmp_path / METRICS)


def test_a_folder_is_held_by_one_training_at_a_time(tmp_path: Path):
    folder = create_run_folder(tmp_path / "run")
    with hold_folder(folder), pytest.raises(ConfigError, match=f"resume={folder}: it is training"), hold_folder(folder):
        pass
    with hold_folder(folder):
        pass


def test_a_disk_without_locks_is_not_taken_for_a_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: Any) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    for way in ("flock", "lockf"):
        monkeypatch.setattr(fcntl, way, refuse)
    folder = create_run_folder(tmp_path / "run")
    expected = f"run_dir={folder}: allowed is a folder on a disk that can lock files \\(No locks available\\)"
    with pytest.raises(ConfigError, match=expected), hold_folder(folder):
        pass


def test_a_folder_that_cannot_be_held_is_refused(tmp_path: Path):
    with (
        pytest.raises(ConfigError, match=r"run_dir=.*: allowed is a folder that can be written to \("),
        hold_folder(tmp_path),
    ):
        pass
