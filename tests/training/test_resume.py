"""Runs that are killed and taken up again: nothing is lost, and what follows is what would have followed."""

from __future__ import annotations

import csv
import json
import shutil
import signal
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from processes import ROOT, SMALL, assert_whole, call, start
from rerun.chunk import RrdReader

from benchmarks.faults import SCRIPT
from ibe_rl.storage.checkpoint import BEST, BETWEEN, EVALUATED, LATEST, PREDICTOR, load, policies
from ibe_rl.storage.folder_lock import hold_folder
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.training.resume import read_state, without_episodes
from ibe_rl.training.state import PARTS
from ibe_rl.types import ConfigError

RUN = [
    *SMALL,
    *("collect.steps_per_batch=32", "checkpoint_every_frames=1500", "keep_policy_every_frames=1000"),
    *("explain_every_steps=20", "min_confidence=0.1", "mapping.spans_steps=[40]", "predictor.futures=2"),
    "first_refresh_episodes=10",
]
EXPLORING = ("agent.mirror=true", "agent.noise_steps=10")  # as the lander's default
AGENTS = {
    "ppo": ["viewer=file", *EXPLORING, "agent.minibatch_size=64", "obedience.weight=1"],
    "dqn": [
        "viewer=off",
        "agent=dqn",
        *EXPLORING,
        "predictor=ensemble",
        "predictor.updates=5",
        "collect.overlap=false",
        "agent.hidden=[16]",
        "agent.learn_after_frames=500",
        "agent.epsilon_share=0.5",
    ],
    "found": [  # how far ahead is explained
        *("viewer=off", "agent.minibatch_size=64", "mapping.horizon_steps=null", "predictor=regression"),
        "obedience.judge=oracle",
    ],
    "continuous": ["viewer=off", "env=lander_continuous", "agent.minibatch_size=64"],
}
SLOW = [name if name != "continuous" else pytest.param(name, marks=pytest.mark.soak) for name in AGENTS]
KILL = """
import os, signal
from ibe_rl.storage.run_folder import MetricsTable
write = MetricsTable.write
def write_and_die(self, row):
    write(self, row)
    if row["frames"] >= {frames}:
        os.kill(os.getpid(), signal.SIGKILL)
MetricsTable.write = write_and_die
"""
Folders = tuple[Path, Path, Path]


def killed(folder: Path, *settings: str, frames: int = 4000) -> Path:
    """Start a training that is killed when it has written its row of so many frames."""
    script = SCRIPT.format(patch=KILL.format(frames=frames))
    process = start("-c", script, *settings, f"run_dir={folder}", PYTHONPATH=str(ROOT))
    output, _ = process.communicate(timeout=240)
    assert process.returncode == -signal.SIGKILL, output
    return folder


@pytest.fixture(scope="module")
def sittings(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Folders]:
    """Of an agent: an uninterrupted run, one as it was killed, and that one taken up again."""

    @cache
    def make(agent: str) -> Folders:
        place, settings = tmp_path_factory.mktemp(agent), [*RUN, *AGENTS[agent]]
        call("train", *settings, f"run_dir={place / 'whole'}")
        left = killed(place / "run", *settings)
        shutil.copytree(left, place / "left")
        call("train", f"resume={left}")
        return place / "whole", place / "left", place / "run"

    return make


@pytest.fixture(params=SLOW)
def folders(request: pytest.FixtureRequest, sittings: Callable[[str], Folders]) -> Folders:
    return sittings(request.param)


@pytest.fixture
def ppo(sittings: Callable[[str], Folders]) -> Folders:
    return sittings("ppo")


@pytest.fixture
def left(ppo: Folders, tmp_path: Path) -> Path:
    """A run of its own that was killed."""
    return Path(shutil.copytree(ppo[1], tmp_path / "run"))


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "metrics.csv").open(newline="") as stream:
        timed = [dict(row) for row in csv.DictReader(stream)]
    return [{name: value for name, value in row.items() if not name.startswith("time/")} for row in timed]


def test_it_was_killed_between_two_checkpoints(folders: Folders) -> None:
    _, left, _ = folders
    assert load(left / "checkpoints" / LATEST)["frames"] < int(rows(left)[-1]["frames"]) == 4096
    assert not (left / "summary.json").exists()


def test_every_number_is_that_of_the_uninterrupted_run(folders: Folders) -> None:
    whole, _, resumed = folders
    assert rows(resumed) == rows(whole)
    assert len(rows(whole)) == 24


def test_dqn_learns(sittings: Callable[[str], Folders]) -> None:
    whole = sittings("dqn")[0]
    assert float(rows(whole)[-1]["train/q_loss"]) > 0
    assert json.loads((whole / "summary.json").read_text())["agent"] == "dqn"


def test_every_refresh_is_that_of_the_uninterrupted_run(folders: Folders) -> None:
    whole, _, resumed = folders
    names = [path.name for path in sorted((whole / "refreshes").glob("*.json"))]
    assert len(names) == 4  # the first one early
    assert int(Path(names[0]).stem) < 2000
    assert names == [path.name for path in sorted((resumed / "refreshes").glob("*.json"))]
    for name in names:
        assert (whole / "refreshes" / name).read_text() == (resumed / "refreshes" / name).read_text()


def test_every_episode_is_that_of_the_uninterrupted_run(folders: Folders) -> None:
    logs = [TrajectoryLog.open(folder / "trajectories") for folder in (folders[0], folders[2])]
    assert np.array_equal(logs[0].index, logs[1].index)
    whole, resumed = (log.read(range(len(log.index))) for log in logs)
    for one, other in zip(whole, resumed, strict=True):
        for name in ("states", "actions", "rewards", "instructions", "given"):
            assert np.array_equal(getattr(one, name), getattr(other, name))


def test_every_policy_is_that_of_the_uninterrupted_run(folders: Folders) -> None:
    kept = [policies(folder / "checkpoints", EVALUATED, BETWEEN) for folder in (folders[0], folders[2])]
    assert kept[0].keys() == kept[1].keys()
    assert len(kept[0]) > 3
    for frames, path in kept[0].items():
        one, other = load(path), load(kept[1][frames])
        assert all(torch.equal(one[name], other[name]) for name in one)


def test_every_predictor_is_that_of_the_uninterrupted_run(sittings: Callable[[str], Folders]) -> None:
    whole, _, resumed = (policies(folder / "checkpoints", PREDICTOR) for folder in sittings("dqn"))
    assert len(whole) == 4
    assert whole.keys() == resumed.keys()
    for frames, path in whole.items():
        one, other = load(path), load(resumed[frames])
        assert one["times"] == other["times"]
        assert all(torch.equal(one["layers"][name], other["layers"][name]) for name in one["layers"])


def test_what_had_been_logged_after_the_checkpoint_is_kept_aside(folders: Folders) -> None:
    _, left, resumed = folders
    at = load(left / "checkpoints" / LATEST)["frames"]
    aside = rows(resumed / "replaced" / "1")
    assert aside == [row for row in rows(left) if int(row["frames"]) > at]
    assert aside


def test_the_summary_counts_all_sittings(folders: Folders) -> None:
    whole, _, resumed = (json.loads((folder / "summary.json").read_text()) for folder in (*folders[:1] * 2, folders[2]))
    timed = ("wall_s", "frames_per_s", "time_s")
    assert {k: v for k, v in whole.items() if k not in timed} == {k: v for k, v in resumed.items() if k not in timed}
    assert resumed["wall_s"] > sum(resumed["time_s"].values()) * 0.5


def test_the_recording_goes_on_whole(folders: Folders) -> None:
    whole, _, resumed = folders
    if not (whole / "recording.rrd").exists():
        assert not (resumed / "recording.rrd").exists()
        return
    assert_whole(resumed / "recording.rrd")
    assert not (resumed / "recording.earlier.rrd").exists()
    of_whole, of_resumed = recorded(whole), recorded(resumed)
    assert of_resumed == of_whole
    assert len(of_whole) > 20


def recorded(folder: Path) -> Counter[str]:
    """How often each thing was recorded; what is set once and for all may have been set at both beginnings."""
    rows: Counter[str] = Counter()
    for chunk in RrdReader(folder / "recording.rrd").stream().to_chunks():
        rows[chunk.entity_path] += 0 if chunk.is_static else chunk.num_rows
    return rows


REFUSED = {
    "seed=1": "seed=1 with resume: a run keeps its seed",
    "collect.processes=2": "collect.processes=2 with resume: a run keeps its",
    "collect={processes:2}": "with resume: a run keeps its",
    "agent=dqn": "agent=dqn with resume: a run keeps its",
    "mapping=paper": "mapping=paper with resume: a run keeps its",
    "agent.hidden=[8]": "agent.hidden=[8] with resume: a run keeps its",
    "experiment=paper": "experiment=paper with resume: a run keeps its",
    "total_frames=3000": "allowed with it is a larger total_frames",
    "eval_episodes=0": "eval_episodes",
    "no_such=1": "no_such",
}


@pytest.mark.parametrize("override", REFUSED)
def test_a_setting_that_a_run_keeps_is_refused_by_name(
    override: str, left: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(left.rglob("*"))
    assert REFUSED[override] in refusal(capsys, f"resume={left}", override)
    assert sorted(left.rglob("*")) == before


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that a training which does not begin ends with."""
    with pytest.raises(SystemExit) as ended:
        call("train", *arguments)
    said = capsys.readouterr()
    [line] = [*said.err.splitlines(), *([ended.value.code] if isinstance(ended.value.code, str) else [])]
    return str(line)


def test_settings_that_may_change_take_effect(left: Path) -> None:
    named = [
        "total_frames=5000",
        "eval_episodes=3",
        "refresh_every_frames=700",
        "viewer=off",
        "agent.learning_rate=0.1",
    ]
    call("train", f"resume={left}", *named)
    summary = json.loads((left / "summary.json").read_text())
    assert summary["evaluation_episodes"] == 3
    assert 5000 <= summary["frames"] < 5300
    assert len(list((left / "refreshes").glob("*.json"))) > 3
    saved = (left / ".hydra" / "config.yaml").read_text()
    assert "learning_rate: 0.1" in saved
    assert "mode: 'off'" in saved
    assert "resume: null" in saved
    overrides = (left / ".hydra" / "overrides.yaml").read_text()
    assert all(one.split("=")[0] in overrides for one in named)
    assert "agent=" not in overrides


def test_settings_that_only_its_own_agent_has_take_effect_too(
    sittings: Callable[[str], Folders], tmp_path: Path
) -> None:
    run = Path(shutil.copytree(sittings("dqn")[1], tmp_path / "run"))
    call(
        "train",
        "--config-name=train",
        f"resume='{run}'",
        "agent.epsilon_end=0.2",
        "agent.epsilon_early=0.2",
        "total_frames=5000",
    )
    assert float(rows(run)[-1]["train/epsilon"]) == pytest.approx(0.2)
    assert "epsilon_end: 0.2" in (run / ".hydra" / "config.yaml").read_text()


def test_a_run_that_was_to_stop_goes_on_to_its_end_and_stops_again_only_if_told(left: Path) -> None:
    config = left / ".hydra" / "config.yaml"
    config.write_text(config.read_text().replace("stop_after_frames: null", "stop_after_frames: 3500"))
    call("train", f"resume={left}", "stop_after_frames=4500", "viewer=off")
    assert 4500 <= json.loads((left / "summary.json").read_text())["frames"] < 5000
    call("train", f"resume={left}", "viewer=off")
    assert json.loads((left / "summary.json").read_text())["frames"] >= 6000


def test_the_best_state_can_be_gone_back_to(ppo: Folders, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Path(shutil.copytree(ppo[2], tmp_path / "run"))
    best = load(run / "checkpoints" / BEST)["frames"]
    call("train", f"resume={run}", "resume_from=best", "total_frames=6500")
    assert f"resuming at {best:,} frames" in capsys.readouterr().out
    assert json.loads((run / "summary.json").read_text())["frames"] >= 6500
    assert (run / "replaced" / "2" / "summary.json").exists()


def test_a_run_that_has_had_its_frames(ppo: Folders, capsys: pytest.CaptureFixture[str]) -> None:
    assert "it has trained its 6,000 frames" in refusal(capsys, f"resume={ppo[2]}")


def test_a_run_that_is_training_is_left_alone(left: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with hold_folder(left):
        assert "it is training; allowed is a run that has ended" in refusal(capsys, f"resume={left}")


def test_a_folder_that_is_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "not a run folder" in refusal(capsys, f"resume={tmp_path}")


def test_a_recorded_session_is_trained_anew(left: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = left / ".hydra" / "config.yaml"
    config.write_text(
        config.read_text().replace("kind: oracle", "kind: recorded\n  recording: there\n  others: oracle")
    )
    assert "repeats a session from its beginning" in refusal(capsys, f"resume={left}")


def remove(path: Path) -> None:
    path.unlink()


def cut_short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def of_another_kind(path: Path) -> None:
    torch.save({"weights": torch.zeros(2)}, path)


def without_the_log(path: Path) -> None:
    state = load(path)
    torch.save(state | {"log": {}}, path)


DAMAGED: dict[str, tuple[Callable[[Path], None], str]] = {
    "missing": (remove, "it ended before the first one"),
    "cut short": (cut_short, "not a readable checkpoint"),
    "of another kind": (of_another_kind, "not a state of this version"),
    "without a part": (without_the_log, "does not fit this version"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_state_is_refused(damage: str, left: Path, capsys: pytest.CaptureFixture[str]) -> None:
    do, said = DAMAGED[damage]
    do(left / "checkpoints" / LATEST)
    line = refusal(capsys, f"resume={left}").strip()
    assert said in line


def test_a_person_begins_new_episodes(folders: Folders) -> None:
    state = read_state(folders[1], "latest")
    begun = [steps > 0 for steps in state["log"]["open_steps"]]
    assert any(begun)
    asked = without_episodes(state)
    assert not any(asked["log"]["open_steps"])
    ended = zip(asked["log"]["ended"], state["log"]["ended"], strict=True)
    assert [after - before for after, before in ended] == [int(one) for one in begun]
    assert asked["agent"].get("unfinished") is None
    assert asked["obedience"] == {}


def test_a_state_names_all_parts(ppo: Folders) -> None:
    assert set(read_state(ppo[1], "latest")) == {"frames", "counts", *PARTS}
    with pytest.raises(ConfigError, match="it ended before the first one"):
        read_state(ppo[1].parent, "best")
