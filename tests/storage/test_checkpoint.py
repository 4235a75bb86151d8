"""Weights come back as they were, and a file can never make the program run code."""

import pickle
from pathlib import Path
from typing import Any

import pytest
import torch

from ibe_rl.storage.checkpoint import BEST, BETWEEN, EVALUATED, LATEST, load, policies, save_policy, save_state
from ibe_rl.storage.run_folder import CHECKPOINTS
from ibe_rl.types import ConfigError

STATE = {"weight": torch.arange(6.0).reshape(2, 3), "n_averaged": torch.tensor(3)}


class Trap:
    """Would leave a file behind if it were unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


def test_a_policy_comes_back(tmp_path: Path):
    loaded = load(save_policy(tmp_path, 1_000, STATE))
    assert loaded.keys() == STATE.keys()
    assert all(torch.equal(loaded[name], STATE[name]) for name in STATE)


def test_policies_are_kept_side_by_side_in_rising_order(tmp_path: Path):
    paths = {frames: save_policy(tmp_path, frames, STATE) for frames in (900, 10_000, 2_000)}
    (tmp_path / LATEST).touch()
    (tmp_path / "policy_x.pt").touch()
    (tmp_path / "policy_5.pt.partial").touch()
    assert list(policies(tmp_path).items()) == sorted(paths.items())
    assert policies(tmp_path / "none") == {}


def test_policies_kept_between_evaluations_are_only_seen_by_who_asks_for_them(tmp_path: Path):
    evaluated = {frames: save_policy(tmp_path, frames, STATE) for frames in (3_000, 1_000)}
    between = {frames: save_policy(tmp_path, frames, STATE, BETWEEN) for frames in (20_000, 2_000)}
    assert policies(tmp_path) == policies(tmp_path, EVALUATED) == evaluated
    assert list(policies(tmp_path, BETWEEN).items()) == sorted(between.items())
    assert list(policies(tmp_path, EVALUATED, BETWEEN).items()) == sorted((evaluated | between).items())


def test_the_full_state_replaces_the_one_before(tmp_path: Path):
    folder = tmp_path / CHECKPOINTS
    folder.mkdir()
    for frames in (1, 2, 3):
        save_state(tmp_path, {"agent": {"loss": STATE}, "frames": frames, "counts": {"best_frames": 2}})
    assert {path.name for path in folder.iterdir()} == {LATEST, BEST}
    assert load(folder / LATEST)["frames"] == 3
    assert load(folder / BEST)["frames"] == 2


@pytest.mark.parametrize("write", [torch.save, lambda state, path: path.write_bytes(pickle.dumps(state, 2))])
def test_code_in_a_checkpoint_is_refused_and_does_not_run(tmp_path: Path, write: Any):
    sprung, path = tmp_path / "sprung", tmp_path / "policy_000000000001.pt"
    write({"weight": STATE["weight"], "trap": Trap(sprung)}, path)
    with pytest.raises(ConfigError, match=rf"{path}: not a readable checkpoint \("):
        load(path)
    assert not sprung.exists()
    with path.open("rb") as stream:  # the trap is a real one
        torch.load(stream, weights_only=False) if write is torch.save else pickle.load(stream)  # noqa: S301 - a trap that must go off
    assert sprung.exists()


@pytest.mark.parametrize("keep", [0, 1, 100, -10])
def test_a_damaged_checkpoint_is_refused(tmp_path: Path, keep: int):
    path = save_policy(tmp_path, 1, STATE)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(ConfigError, match=f"{path}: not a readable checkpoint") as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_a_missing_checkpoint_is_refused(tmp_path: Path):
    with pytest.raises(ConfigError, match="not a readable checkpoint"):
        load(tmp_path / "none.pt")
