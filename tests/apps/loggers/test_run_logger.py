"""What loggers are told, and that none of them stops a training."""

from __future__ import annotations

import sys
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from processes import ROOT, SMALL, call
from told import run, train
from torchrl.record.loggers import CSVLogger, Logger

from ibe_rl.apps.loggers.csv import Csv
from ibe_rl.apps.loggers.run_logger import RunLogger, flat, installed_package
from ibe_rl.config.command_line import composed
from ibe_rl.config.settings import LoggerConfig
from ibe_rl.storage.run_folder import METRICS, read_rows
from ibe_rl.types import ConfigError

FEW = ["viewer=off", "refresh_every_frames=null", "eval_every_frames=4000"]


class Hanging(Csv):
    """Its server never answers."""

    held = Event()

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        self.held.wait()
        return super().open(folder, resumed_at)


class Broken(Csv):
    """Fails when it is given a picture."""

    def picture(self, name: str, png: bytes, frames: int) -> None:
        raise ConnectionError("no route to host")


def test_one_that_hangs_is_not_waited_for(tmp_path: Path) -> None:
    logger = Hanging(LoggerConfig(kind="", waiting_events=3, closing_s=0.01, pictures=False))
    lines = train(logger, run(tmp_path / "run"), until=100)
    assert lines == [
        "warning: logger=csv: 3 events wait for it; further ones are left out until it takes them. metrics.csv and "
        "refreshes/ have all of it",
        "warning: logger=csv: it did not take everything within loggers.csv.closing_s=0.01 s; metrics.csv and "
        "refreshes/ have all of it",
    ]
    Hanging.held.set()


class Notebooks(Csv):
    """Looks in its thread for what wandb and mlflow import there."""

    whole = False

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        Notebooks.whole = hasattr(sys.modules.get("IPython"), "version_info")
        return super().open(folder, resumed_at)


def test_matplotlib_never_sees_half_of_what_a_logger_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [one for one in sys.modules if one.partition(".")[0] == "IPython"]:
        monkeypatch.delitem(sys.modules, name)
    train(Notebooks(LoggerConfig(kind="")), run(tmp_path / "run"), until=10)
    assert Notebooks.whole


def test_one_that_fails_is_named_and_dropped(tmp_path: Path) -> None:
    lines = train(Broken(LoggerConfig(kind="")), run(tmp_path / "run"), until=40)
    [warning] = [line for line in lines if line.startswith("warning")]
    assert "the listener Broken failed (ConnectionError: no route to host)" in warning
    assert (tmp_path / "run/loggers/csv/scalars/train/return_mean.csv").read_text().startswith("10,5.0\n")


def test_one_that_never_began_is_closed_without_a_word() -> None:
    logger = Csv(LoggerConfig(kind=""))
    logger.close()
    logger.skipped(1, "nothing")
    assert [*logger.news()] == []


def test_without_pictures_none_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ibe_rl.apps.loggers.run_logger.pictures_of", None)
    lines = train(Csv(LoggerConfig(kind="", pictures=False)), run(tmp_path / "run"), until=40)
    assert lines == [f"logger=csv: {tmp_path / 'run/loggers/csv'}"]
    assert not (tmp_path / "run/loggers/csv/pictures").exists()


def test_settings_are_flat() -> None:
    assert flat({"a": {"b": {"c": 1}, "d": None, "e": {}}, "f": [1, "x"], "g": "y", "h": True}) == {
        "a.b.c": 1,
        "a.d": "null",
        "a.e": "{}",
        "f": '[1, "x"]',
        "g": "y",
        "h": True,
    }


def test_a_folder_of_that_name_is_no_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a_package_nobody_has").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    assert not installed_package("a_package_nobody_has")
    assert not installed_package("another_one")
    assert installed_package("torchrl")


@pytest.mark.parametrize("name", ["tensorboard", "wandb", "mlflow"])
def test_a_package_that_is_missing_is_named_before_anything_is_made(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ibe_rl.apps.loggers.run_logger.find_spec", lambda _: None)
    line = rf"^error: logger={name}: needs the package {name}; pip install 'ibe_rl\[{name}\]'$"
    with pytest.raises(SystemExit, match=line):
        call("train", f"logger={name}", f"run_dir={tmp_path / 'run'}", "viewer=off")
    assert not (tmp_path / "run").exists()


def test_an_extra_installs_each() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    for kind in RunLogger.__subclasses__():
        assert not kind.package or f'{kind.name} = ["{kind.package}>=' in text


def test_several_are_chosen_and_set_by_name() -> None:
    assert composed("train", []).loggers == {}
    config = composed("train", ["logger=[csv,tensorboard]", "loggers.csv.pictures=false"])
    assert {name: one.pictures for name, one in config.loggers.items()} == {"csv": False, "tensorboard": True}
    assert [*composed("train", ["logger=csv"]).loggers] == ["csv"]
    with pytest.raises(ConfigError, match=r"loggers\.csv\.closing_s=-1\.0: allowed is at least 0"):
        composed("train", ["logger=csv", "loggers.csv.closing_s=-1"])
    with pytest.raises(ConfigError, match=r"logger=pencil: allowed is one of csv, mlflow, tensorboard, wandb"):
        composed("train", ["logger=pencil"])


def columns(folder: Path) -> dict[str, list[int]]:
    """Frames of each curve."""
    return {
        str(path.relative_to(folder / "loggers/csv/scalars").with_suffix("")): [
            int(line.partition(",")[0]) for line in path.read_text().splitlines()
        ]
        for path in (folder / "loggers/csv/scalars").rglob("*.csv")
    }


def test_a_training_is_logged_and_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "run"
    monkeypatch.setattr(sys, "argv", [])
    call("train", *SMALL, *FEW, f"run_dir={folder}", "logger=csv", "stop_after_frames=3000")
    begun = columns(folder)
    call("train", f"resume={folder}")
    rows = read_rows(folder / METRICS)
    assert columns(folder)["train/return_mean"][: len(begun["train/return_mean"])] == begun["train/return_mean"]
    for name, frames in columns(folder).items():
        assert frames == [int(row["frames"]) for row in rows if row[name] not in ("", "nan")], name
    assert {name for name in rows[0] if any(row[name] not in ("", "nan") for row in rows)} == {
        "frames",
        *columns(folder),
    }
    call("train", f"resume={folder}", "total_frames=7000", "logger=[]")
    assert max(columns(folder)["train/return_mean"]) < 7000  # logger=[] beside resume: no longer


def test_every_kind_is_a_logger_of_torchrl(tmp_path: Path) -> None:
    found: Any = Csv(LoggerConfig(kind="")).open(tmp_path, None)
    assert isinstance(found, CSVLogger)
