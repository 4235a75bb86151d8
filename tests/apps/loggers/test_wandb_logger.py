"""What Weights & Biases keeps offline, read from its own file."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from told import run, train
from view_data import eventually, needed

from ibe_rl.apps.loggers.wandb import Wandb, WandbConfig
from ibe_rl.storage.run_folder import read_json, refuse_special_files
from ibe_rl.types import ConfigError

OFFLINE = WandbConfig(kind="", mode="offline", closing_s=120.0)


pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    needed(find_spec("wandb") is not None, "wandb")
    monkeypatch.setenv("HOME", str(tmp_path))  # its own settings and credentials are not ours
    monkeypatch.delenv("WANDB_API_KEY", raising=False)
    monkeypatch.setenv("WANDB_MODE", "online")  # TorchRL sets it; this sets it back


def records(folder: Path) -> list[Any]:
    """Of all files, once each is whole: the package's own process writes the end after it has said that it is done."""
    files = sorted(folder.rglob("*.wandb"))
    assert eventually(lambda: all(any(record.HasField("exit") for record in records_of(path)) for path in files))
    return [record for path in files for record in records_of(path)]


def records_of(path: Path) -> list[Any]:
    from wandb.proto import wandb_internal_pb2

    return [wandb_internal_pb2.Record.FromString(data) for data in leveldb_records(path.read_bytes())]


def leveldb_records(data: bytes) -> Iterator[bytes]:
    """Of a log as LevelDB writes it: blocks of 32 kB, records in parts of the types whole, first, middle, last."""
    place, parts, block = 7, b"", 32_768  # behind the file's own header
    while place + 7 <= len(data):
        if block - place % block < 7:
            place += block - place % block
        length, kind = struct.unpack("<HB", data[place + 4 : place + 7])
        if place + 7 + length > len(data):
            return  # it is still being written
        parts += data[place + 7 : place + 7 + length]
        place += 7 + length
        if kind in (1, 4):
            yield parts
            parts = b""


def history(found: list[Any]) -> list[dict[str, Any]]:
    rows = [record.history.item for record in found if record.HasField("history")]
    return [{item.key or "/".join(item.nested_key): json.loads(item.value_json) for item in row} for row in rows]


def test_it_keeps_curves_tables_pictures_and_settings(tmp_path: Path) -> None:
    lines = train(Wandb(OFFLINE), run(tmp_path / "run"), until=40)
    folder = tmp_path / "run/loggers"
    assert [line.partition(" wandb sync ")[0] for line in lines] == ["logger=wandb:"]
    found = records(folder)
    rows = history(found)
    curve = [(row["train/step"], row["train/return_mean"]) for row in rows if "train/return_mean" in row]
    assert curve == [(10, 5.0), (20, 10.0), (30, 15.0), (40, 20.0)]
    kinds = {
        name.removesuffix("/_type"): value
        for row in rows
        for name, value in row.items()
        if name.startswith("refresh/") and name.endswith("/_type")
    }
    assert kinds == {
        "refresh/vocabulary": "html-file",
        "refresh/phrases": "table-file",
        "refresh/clusters": "image-file",
        "refresh/episode": "image-file",
        "refresh/skipped": "html-file",
    }
    [table] = folder.rglob("*.table.json")
    told = read_json(table)
    assert told["columns"][:3] == ["cluster", "expression", "phrase"]
    assert len(told["data"]) == 8
    refuse_special_files(tmp_path / "run")  # no links: it can be resumed


def test_a_run_that_goes_on_is_the_same(tmp_path: Path) -> None:
    train(Wandb(OFFLINE), run(tmp_path / "run"), until=20)
    train(Wandb(OFFLINE), run(tmp_path / "run", resumed_at=20), until=40)
    found = records(tmp_path / "run/loggers")
    ids = [record.run.run_id for record in found if record.HasField("run")]
    assert len(ids) >= 2
    assert {*ids} == {read_json(tmp_path / "run/loggers/wandb.json")["id"]}
    assert [row["train/step"] for row in history(found) if "train/return_mean" in row] == [10, 20, 30, 40]


def test_online_somebody_has_to_be_logged_in() -> None:
    with pytest.raises(ConfigError, match=r"loggers\.wandb\.mode=online: nobody is logged in .*allowed.* is offline"):
        Wandb(WandbConfig(kind=""))
