"""Long arrays in a file, as D4RL's, are whole episodes: with the last state, or without the last action."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from bead import BEAD_ID, to_zero
from numpy.testing import assert_allclose, assert_array_equal

from ibe_rl.apps.datasets.arrays import Arrays
from ibe_rl.apps.datasets.importing import import_log
from ibe_rl.envs.make import make_gym
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.types import ConfigError


def driven(episodes: int = 20) -> dict[str, Any]:
    """Episodes of the bead, of 30 steps, the fourth of which breaks off."""
    env, columns = make_gym(BEAD_ID, {"masked": False}), {name: [] for name in ("s", "n", "a", "r", "t")}
    for seed in range(episodes):
        state, truncated = env.reset(seed=seed)[0], False
        while not truncated:
            action = int(to_zero(state)[0]) + 1
            after, reward, _, truncated, _ = env.step(action)
            for name, value in zip("snart", (state, after, action, reward, truncated), strict=True):
                columns[name].append(value)
            state = after
    names = ("observations", "next_observations", "actions", "rewards", "timeouts")
    found = {name: np.array(column) for name, column in zip(names, columns.values(), strict=True)}
    return found | {"terminals": np.zeros(len(found["rewards"]), bool)}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def saved(path: Path, columns: dict[str, Any]) -> str:
    if path.suffix == ".npz":
        np.savez(path, **columns)
        return str(path)
    with h5py.File(path, "w") as file:
        for name, column in columns.items():
            file[name] = column
    return str(path)


def settings(tmp_path: Path) -> list[str]:
    quick = ["mapping.horizon_steps=5", "mapping.spans_steps=[3]", "mapping.top_fraction=1"]
    (tmp_path / "configs" / "env").mkdir(parents=True)
    text = f"defaults: [schema]\nid: bead:{BEAD_ID}\nkwargs: {{masked: false}}\n"
    (tmp_path / "configs" / "env" / "bead.yaml").write_text(text)
    return ["env=bead", *quick, f"run_dir={tmp_path / 'run'}"]


@pytest.mark.parametrize("suffix", [".npz", ".hdf5"])
def test_a_file_is_explained_by_the_rule_of_the_environment(suffix: str, tmp_path: Path, capsys: Any) -> None:
    columns = driven() | {"infos/success": np.ones(600, bool)}
    folder = import_log(saved(tmp_path / f"set{suffix}", columns), settings(tmp_path))
    log = TrajectoryLog.open(folder / "trajectories")
    episodes = log.read(range(20))
    assert len(log.index) == 20
    for number, episode in enumerate(episodes):
        rows = slice(30 * number, 30 * number + 30)
        assert_array_equal(episode.states[:-1], columns["observations"][rows])
        assert_array_equal(episode.states[-1], columns["next_observations"][rows][-1])
        assert_array_equal(episode.instructions, to_zero(episode.states[:-1]))
        assert (episode.terminated, episode.success) == (False, True)
    assert "note" not in capsys.readouterr().out


def test_without_next_observations_the_last_action_is_left_out_and_the_return_stays(
    tmp_path: Path, capsys: Any
) -> None:
    columns = driven()
    del columns["next_observations"], columns["terminals"]
    columns = {name: column[:-10] for name, column in columns.items()}  # the last one breaks off
    folder = import_log(saved(tmp_path / "set.npz", columns), settings(tmp_path))
    episodes = TrajectoryLog.open(folder / "trajectories").read(range(20))
    assert [len(one) for one in episodes] == [29] * 19 + [19]
    assert_array_equal(episodes[3].states, columns["observations"][90:120])
    assert_allclose(episodes[3].total_reward, columns["rewards"][90:120].sum(), rtol=1e-5)
    printed = capsys.readouterr().out
    assert "20 of 20 episodes have no info that says whether they succeeded" in printed
    assert "1 of 20 episodes have no end; they count as truncated" in printed


def test_an_instruction_in_words_is_one_of_its_arrays(tmp_path: Path) -> None:
    columns = driven()
    values = {-1: b"going left", 0: b"staying", 1: b"going right"}
    words = np.array([values[int(one)] for one in to_zero(columns["observations"])[:, 0]])
    path = saved(tmp_path / "set.hdf5", columns | {"infos/command": words})
    folder = import_log(path, settings(tmp_path), "command")
    for episode in TrajectoryLog.open(folder / "trajectories").read(range(20)):
        assert_array_equal(episode.instructions, to_zero(episode.states[:-1]))


def test_what_is_no_such_file_is_refused(tmp_path: Path) -> None:
    good = driven(2)

    def refused(line: str, name: str = "set.npz", **changes: Any) -> None:
        columns = {name: column for name, column in (good | changes).items() if column is not None}
        with pytest.raises(ConfigError, match=line):
            list(Arrays.read(Path(saved(tmp_path / name, columns))).episodes())

    refused("set.npz: it has no rewards; allowed are arrays called observations, actions, rewards", rewards=None)
    refused("terminations has 5 rows and rewards has 60; allowed is the same", terminals=np.zeros(5, bool))
    refused("terminals and timeouts never say that an episode ends; allowed is an end of each", timeouts=None)
    refused("truncations are of type <U1; allowed is one bool a row", timeouts=np.full(60, "n"))
    shuffled = np.random.default_rng(0).permutation(60)
    mixed = {name: column[shuffled] for name, column in good.items()}
    refused("next_observations are not the observations of the next rows; allowed are whole episodes in order", **mixed)
    refused("next_observations are not", next_observations=good["next_observations"][:, :1])
    refused(r"set.npz: it cannot be read \(.*allow_pickle", rewards=np.full(60, None))
    (tmp_path / "text.hdf5").write_text("text")
    for name, why in (("text.hdf5", "it cannot be read"), ("missing.npz", "no such file")):
        with pytest.raises(ConfigError, match=f"dataset=.*{name}: {why}"):
            Arrays.read(tmp_path / name)


def test_hdf5_needs_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "set.hdf5").touch()
    with pytest.raises(ConfigError, match=r"needs h5py .*; install the extra ibe_rl\[minari\]"):
        Arrays.read(tmp_path / "set.hdf5")
