"""What fails or is interrupted leaves nothing behind, and the next try is not refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from ibe_rl.storage import run_folder
from ibe_rl.storage.run_folder import CONFIG, METRICS, create_run_folder, find_run, write_json
from ibe_rl.storage.whole_folder import begun_folder, unused, whole_file, whole_folder
from ibe_rl.types import ConfigError


def files_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def fail(file: Path, error: type[BaseException], frames: int = 0) -> None:
    """Write a file, then raise an error."""
    write_json(file, {"frames": frames})
    raise error


def test_a_folder_has_its_name_once_it_is_whole(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "runs" / "run") as folder:
        (folder / "summary.json").write_text("{}")
        assert not (tmp_path / "runs" / "run").exists()
        with pytest.raises(ConfigError, match="there is no run below"):
            find_run(None, tmp_path)
    assert files_in(tmp_path) == ["runs/run/.hydra/config.yaml", "runs/run/summary.json"]
    assert find_run(None, tmp_path) == tmp_path / "runs" / "run"


@pytest.mark.parametrize("error", [ConfigError, KeyboardInterrupt, OSError])
def test_what_fails_leaves_nothing_and_the_next_try_works(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), whole_folder(tmp_path / "run") as folder:
        fail(folder / "summary.json", error)
    assert [*tmp_path.iterdir()] == []
    with whole_folder(tmp_path / "run"):
        pass
    assert (tmp_path / "run" / CONFIG).exists()


def test_what_a_killed_program_left_is_not_in_the_way(tmp_path: Path) -> None:
    create_run_folder(tmp_path / "run.partial")
    (tmp_path / "run.partial" / "left").touch()
    with whole_folder(tmp_path / "run"):
        pass
    assert files_in(tmp_path) == ["run/.hydra/config.yaml"]


def test_what_another_program_is_making_is_left_to_it(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "run") as folder:
        (folder / "mine").touch()
        refusal = r"run_dir=.*/run: another program is making it; allowed is a new folder"
        with pytest.raises(ConfigError, match=refusal), whole_folder(tmp_path / "run"):
            pass
        assert (folder / "mine").exists()
    assert files_in(tmp_path) == ["run/.hydra/config.yaml", "run/mine"]


def test_trainings_that_begin_in_the_same_second_have_folders_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "2026-11-28_10-00-00"
    with begun_folder(path, numbered=True) as one, begun_folder(path, numbered=True) as other:
        assert (one, other) == (path, tmp_path / "2026-11-28_10-00-00_2")
        with begun_folder(path, numbered=True) as third:
            assert third.name.endswith("_3")
    with pytest.raises(ConfigError, match=r"run_dir=.*_10-00-00: holds a run already"), begun_folder(path):
        pass


def test_the_first_name_that_nobody_uses_is_found(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "2026-11-28_10-00-00"
    assert unused(path) == path
    create_run_folder(path)
    assert unused(path) == path.with_name("2026-11-28_10-00-00_2")
    with whole_folder(unused(path)):
        assert unused(path) == path.with_name("2026-11-28_10-00-00_3")  # another program is making the second
    assert unused(path) == path.with_name("2026-11-28_10-00-00_3")


def test_a_folder_that_another_training_begins_at_the_same_moment_is_refused_and_left_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    create_run_folder(tmp_path / "run")
    before = files_in(tmp_path)
    monkeypatch.setattr(run_folder, "refuse_used", lambda _: None)  # it looked a moment too soon
    with pytest.raises(ConfigError, match=r"run_dir=.*/run: holds a run already"), begun_folder(tmp_path / "run"):
        pass
    assert files_in(tmp_path) == before


def test_what_is_there_stays(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    with whole_folder(tmp_path):
        pass
    assert files_in(tmp_path) == [".hydra/config.yaml", "notes.txt"]
    with pytest.raises(ConfigError, match=r"run_dir=.*: holds a run already"), whole_folder(tmp_path):
        pass


def test_a_folder_that_cannot_be_made_is_called_by_its_own_name(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    refusal = r"run_dir=.*/file/run: allowed is a folder that can be written to"
    with pytest.raises(ConfigError, match=refusal), whole_folder(tmp_path / "file" / "run"):
        pass
    (tmp_path / "run" / "checkpoints").mkdir(parents=True)
    (tmp_path / "run" / "checkpoints" / "mine").touch()
    with pytest.raises(ConfigError, match=r"run_dir=.*/run: allowed is a new folder"), whole_folder(tmp_path / "run"):
        pass


def test_a_training_that_has_logged_nothing_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "output.log").touch()
    for name in ("new", "there"):
        with pytest.raises(RuntimeError), begun_folder(tmp_path / name) as folder:
            fail(folder / "trajectories" / "log.json", RuntimeError)
    assert files_in(tmp_path) == ["there/output.log"]
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("logged", [METRICS, "trajectories/log.json", "trajectories/number.npy"])
def test_a_training_that_has_logged_something_keeps_it(tmp_path: Path, logged: str) -> None:
    with pytest.raises(KeyboardInterrupt), begun_folder(tmp_path / "run") as folder:
        fail(folder / logged, KeyboardInterrupt, frames=64)
    assert files_in(tmp_path) == ["run/.hydra/config.yaml", f"run/{logged}"]


def test_a_file_takes_its_name_once_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "new" / "film.rrd"
    with whole_file(path, "output") as partial:
        partial.write_text("whole")
        assert not path.exists()
    assert path.read_text() == "whole"
    assert [*path.parent.iterdir()] == [path]


def test_a_file_that_fails_leaves_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "film.rrd"
    path.write_text("before")
    with pytest.raises(KeyboardInterrupt), whole_file(path, "output") as partial:
        fail(partial, KeyboardInterrupt)
    assert path.read_text() == "before"
    assert [*tmp_path.iterdir()] == [path]


def test_a_file_that_cannot_be_written_is_named_by_its_setting(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    refusal = r"output=.*/file/film.rrd: allowed is a file that can be written"
    with pytest.raises(ConfigError, match=refusal), whole_file(tmp_path / "file" / "film.rrd", "output"):
        pass
