"""The files of ``logger=csv`` hold what a training says."""

from __future__ import annotations

from pathlib import Path

import pytest
from told import run, train

from ibe_rl.apps.loggers.csv import Csv
from ibe_rl.config.settings import LoggerConfig


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.*") if path.is_file()}


@pytest.mark.slow
def test_it_holds_curves_texts_and_pictures(tmp_path: Path) -> None:
    lines = train(Csv(LoggerConfig(kind="")), run(tmp_path / "run"), until=40)
    folder = tmp_path / "run/loggers/csv"
    assert lines == [f"logger=csv: {folder}"]
    found = files(folder)
    assert found.pop("scalars/train/return_mean.csv") == b"10,5.0\n20,10.0\n30,15.0\n40,20.0\n"
    assert found.pop("scalars/time/learn.csv") == b"10,1.5\n20,1.5\n30,1.5\n40,1.5\n"
    assert b"| #0 | " in found.pop("texts/refresh/vocabulary_000000000020.md")
    assert found.pop("texts/refresh/skipped_000000000040.md") == b"too little <b>\n"
    assert b'"success_rate": 0.5' in found.pop("texts/summary_000000000040.md")
    assert b"    agent.hidden: [8, 8]\n" in found.pop("texts/settings_000000000000.md")
    assert b"agent.kind: dqn" in found.pop("texts/hparams0.txt")
    assert {name: content[:4] for name, content in found.items()} == {
        f"pictures/refresh/{name}_000000000020.png": b"\x89PNG" for name in ("clusters", "episode")
    }


@pytest.mark.slow
def test_a_run_that_goes_on_drops_what_lies_beyond(tmp_path: Path) -> None:
    train(Csv(LoggerConfig(kind="")), run(tmp_path / "run"), until=40)
    curve = tmp_path / "run/loggers/csv/scalars/train/return_mean.csv"
    with curve.open("a") as stream:
        stream.write("5")  # killed in the middle of a line
    train(Csv(LoggerConfig(kind="")), run(tmp_path / "run", resumed_at=20), until=60)
    assert curve.read_text() == "10,5.0\n20,10.0\n30,15.0\n40,20.0\n50,25.0\n60,30.0\n"
    begun = run(tmp_path / "other")
    train(Csv(LoggerConfig(kind="")), begun, until=40)
    train(Csv(LoggerConfig(kind="")), run(tmp_path / "other", resumed_at=0), until=10)
    assert (tmp_path / "other/loggers/csv/scalars/train/return_mean.csv").read_text() == "10,5.0\n"
