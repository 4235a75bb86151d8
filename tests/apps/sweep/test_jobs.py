"""The runs of a sweep by hand: names, folders, and what has become of each."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from ibe_rl.apps.sweep.jobs import NEW, RUN_FINISHED, UNFINISHED, make_way, plan, read_summary, state_of
from ibe_rl.storage.folder_lock import hold_folder
from ibe_rl.types import ConfigError


def run(folder: Path, *overrides: str) -> Path:
    (folder / ".hydra").mkdir(parents=True)
    (folder / ".hydra" / "config.yaml").touch()
    (folder / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump(list(overrides)))
    return folder


def asked(*seeds: int, other: str = "mapping.n_clusters=4") -> list[list[str]]:
    return [[f"seed={seed}", other, "run_dir=anywhere"] for seed in seeds]


def test_runs_are_called_after_what_differs_and_have_folders_that_need_no_quotes(tmp_path: Path) -> None:
    given = [
        [f"agent.hidden={sizes}", f"+env.kwargs.pad={pad}", "seed=1"] for sizes in ("[8,8]", "[16]") for pad in "ab"
    ]
    jobs = plan(tmp_path, given, [10, 20, 30, 40])
    assert jobs[1].name == "agent.hidden=[8,8], env.kwargs.pad=b"
    assert jobs[1].folder == tmp_path / "1_agent.hidden=-8-8-_env.kwargs.pad=b"
    assert jobs[1].overrides == tuple(given[1])
    assert [job.total_frames for job in jobs] == [10, 20, 30, 40]
    assert not list(tmp_path.iterdir())  # nothing is made yet


def test_a_single_run_is_called_after_its_number(tmp_path: Path) -> None:
    [job] = plan(tmp_path, asked(3), [10], first=7)
    assert (job.name, job.folder) == ("7", tmp_path / "7")


def test_a_long_name_is_cut(tmp_path: Path) -> None:
    jobs = plan(tmp_path, [[f"instructor.recording={letter * 400}"] for letter in "ab"], [1, 1])
    assert [len(job.folder.name) for job in jobs] == [100, 100]
    assert jobs[0].folder != jobs[1].folder


def test_a_run_that_was_begun_before_keeps_its_folder_whatever_its_number_is_now(tmp_path: Path) -> None:
    begun = run(tmp_path / "0_seed=5", "mapping.n_clusters=4", "seed=5", "viewer=file", "run_dir='x, y'")
    jobs = plan(tmp_path, asked(4, 5), [10, 10])
    assert [job.folder for job in jobs] == [tmp_path / "0_seed=4", begun]


def test_a_folder_with_a_run_of_other_settings_is_not_touched(tmp_path: Path) -> None:
    run(tmp_path / "1_seed=1", "seed=1", "mapping.n_clusters=5")
    with pytest.raises(
        ConfigError, match=r"1_seed=1 in it is a run with other settings \(mapping.n_clusters=5\); allo"
    ):
        plan(tmp_path, asked(0, 1), [10, 10])


def test_what_has_become_of_a_run(tmp_path: Path) -> None:
    assert state_of(tmp_path / "nothing") == NEW
    one = run(tmp_path / "one")
    assert state_of(one) == NEW
    (one / "checkpoints").mkdir()
    (one / "checkpoints" / "latest.pt").touch()
    assert state_of(one) == UNFINISHED
    (one / "summary.json").write_text(json.dumps({"stopped_early": True}))
    assert state_of(one) == UNFINISHED
    (one / "summary.json").write_text(json.dumps({"stopped_early": False}))
    assert state_of(one) == RUN_FINISHED


@pytest.mark.parametrize("text", ["{", "[]", "\x00"])
def test_a_damaged_summary_is_named(text: str, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text(text)
    with pytest.raises(ConfigError, match=r"summary.json: not the readable summary of a run"):
        read_summary(tmp_path)


def test_the_remains_of_a_run_are_moved_and_nothing_is_lost(tmp_path: Path) -> None:
    for number in (1, 2):
        (run(tmp_path / "0_seed=0") / "metrics.csv").write_text(str(number))
        assert make_way(tmp_path / "0_seed=0") == tmp_path / "replaced" / f"0_seed=0_{number}"
        assert (tmp_path / "replaced" / f"0_seed=0_{number}" / "metrics.csv").read_text() == str(number)
        assert make_way(tmp_path / "0_seed=0") is None


def test_a_run_that_is_training_is_not_moved(tmp_path: Path) -> None:
    one = run(tmp_path / "one")
    with hold_folder(one), pytest.raises(ConfigError, match="it is training"):
        make_way(one)
    assert one.exists()
