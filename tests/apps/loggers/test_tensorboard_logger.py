"""TensorBoard reads back what a training says."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from told import run, train
from view_data import needed

from ibe_rl.apps.loggers.tensorboard import Tensorboard
from ibe_rl.config.settings import LoggerConfig


@pytest.fixture(autouse=True)
def _installed() -> None:
    needed(find_spec("tensorboard") is not None, "tensorboard")


def read(folder: Path) -> Any:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    found = EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 0, "tensors": 0})
    return found.Reload()


def steps(found: Any, name: str) -> list[int]:
    return [one.step for one in found.Scalars(name)]


def texts(found: Any, name: str) -> list[str]:
    return [one.tensor_proto.string_val[0].decode() for one in found.Tensors(f"{name}/text_summary")]


def test_it_reads_curves_texts_pictures_and_settings(tmp_path: Path) -> None:
    lines = train(Tensorboard(LoggerConfig(kind="")), run(tmp_path / "run"), until=40)
    folder = tmp_path / "run/loggers/tensorboard"
    assert lines == [f"logger=tensorboard: tensorboard --logdir {folder}"]
    found = read(folder)
    assert [(one.step, one.value) for one in found.Scalars("train/return_mean")] == [
        (10, 5.0),
        (20, 10.0),
        (30, 15.0),
        (40, 20.0),
    ]
    assert found.Tags()["scalars"] == ["train/return_mean", "time/learn"]
    assert {name: [one.step for one in found.Images(name)] for name in found.Tags()["images"]} == {
        "refresh/clusters": [20],
        "refresh/episode": [20],
    }
    [image] = found.Images("refresh/episode")
    assert (image.width > 800, image.encoded_image_string[:4]) == (True, b"\x89PNG")
    assert "| #0 | " in texts(found, "refresh/vocabulary")[0]
    assert texts(found, "refresh/skipped") == ["too little <b>"]
    assert "success_rate" in texts(found, "summary")[0]
    assert "    agent.kind: dqn\n" in texts(found, "settings")[0]
    content = found.summary_metadata["_hparams_/session_start_info"].plugin_data.content
    assert b"agent.hidden" in content
    assert len(list(folder.iterdir())) == 1  # TensorBoard lists each folder as a run


def test_a_run_that_goes_on_hides_what_lies_beyond(tmp_path: Path) -> None:
    train(Tensorboard(LoggerConfig(kind="")), run(tmp_path / "run"), until=40)
    train(Tensorboard(LoggerConfig(kind="")), run(tmp_path / "run", resumed_at=20), until=60)
    folder = tmp_path / "run/loggers/tensorboard"
    found = read(folder)
    assert steps(found, "train/return_mean") == [10, 20, 30, 40, 50, 60]
    assert [one.step for one in found.Images("refresh/clusters")] == [20]
    assert not [path for path in folder.iterdir() if path.is_dir()]
