"""The scripts as a user runs them: small runs of the real thing."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import SMALL, assert_whole, call, start
from rerun.chunk import RrdReader
from view_data import column, eventually, frames, read

import explain
from benchmarks import foreseeing
from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import EvaluateConfig, TrainConfig
from ibe_rl.evaluation.runs import load_run
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES
from ibe_rl.ibe import ClusterMapping, IBEConfig, normalise
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.quality import OF_THE_MOMENTS, SCORES
from ibe_rl.predict.ensemble import EnsembleConfig
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import CONFIG
from ibe_rl.training.run import TIMES
from ibe_rl.types import DOES_NOT_KNOW
from ibe_rl.vocabulary.probe import PROBE_WINDOWS
from ibe_rl.vocabulary.refresh_columns import REFRESH_COLUMNS

SUMMARY_KEYS = {
    *("frames", "wall_s", "frames_per_s", "episodes", "success_rate", "return_mean", "refreshes"),
    *("refreshes_kept", "refreshes_skipped", "time_s", "meaning", "notes", "seed", "agent", "mapping", "versions"),
}


TWO_SPANS = ["mapping.spans_steps=[10]"]
ASSUMED = "mapping.meaning=assumed"
"""So few episodes cannot tell what the words mean."""


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "metrics.csv").open() as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "small"
    call("train", *SMALL, *TWO_SPANS, ASSUMED, f"run_dir={folder}", "viewer=file")
    return folder


def test_a_run_leaves_what_the_contract_names(run: Path) -> None:
    summary = json.loads((run / "summary.json").read_text())
    assert summary.keys() >= SUMMARY_KEYS
    assert summary["time_s"].keys() == set(TIMES)
    assert sum(summary["time_s"].values()) == pytest.approx(summary["wall_s"], rel=0.05)
    assert summary["frames"] == 6144  # 6,000 rounded up to whole batches of 1,024
    assert summary["refreshes"] + summary["refreshes_kept"] + summary["refreshes_skipped"] == 3
    assert summary["refreshes_kept"] == 0
    assert summary["horizon_steps"] == 20
    assert summary["refreshes"] == len(list((run / "refreshes").glob("*.json"))) >= 1
    assert (run / ".hydra" / "config.yaml").is_file()
    assert [path.name for path in sorted((run / "checkpoints").iterdir())] == [
        "best.pt",
        "latest.pt",
        "policy_000000003072.pt",
        "policy_000000006144.pt",
    ]


def test_metrics_have_a_row_a_batch(run: Path) -> None:
    table = rows(run)
    assert next(iter(table[0])) == "frames"
    assert [int(row["frames"]) for row in table] == [1024 * (i + 1) for i in range(6)]
    assert [bool(row["eval/success_rate"]) for row in table] == [False, False, True, False, False, True]
    assert {name.split("/")[0] for name in table[0]} == {"frames", "train", "eval", "ibe", "time"}


def test_a_refresh_says_what_it_stands_on(run: Path) -> None:
    path = sorted((run / "refreshes").glob("*.json"))[-1]
    refresh = json.loads(path.read_text())
    assert refresh["frame"] == int(path.stem)
    assert refresh["episodes"]["used"] == sum(refresh["episodes"]["by_context"].values())
    assert refresh["episodes"]["used"] == int(np.ceil(0.25 * refresh["episodes"]["counted"]))
    assert refresh["windows"]["used"] == sum(refresh["windows"]["by_context"].values())
    assert refresh["windows"]["used"] == sum(refresh["windows"]["by_instruction"].values())
    assert sum(cluster["size"] for cluster in refresh["clusters"]) == refresh["windows"]["used"]
    spoken = np.array([cluster["expression"] for cluster in refresh["clusters"]])[:, 0]
    mapping, config = ClusterMapping.from_dict(refresh["mapping"]), load_config(run / CONFIG, TrainConfig).mapping
    if config.normalisation == "movement":
        exact = np.clip(mapping.space.spread_out(mapping.centres), -1, 1)
    else:
        exact = normalise(mapping.mean_instructions, config.normalisation)
    assert np.abs(spoken - exact[:, 0]).max() <= config.hold_within  # what has moved by less was held
    assert [span["horizon_steps"] for span in refresh["spans"]] == config.spans_steps == [10]
    for span in refresh["spans"]:
        assert ClusterMapping.from_dict(span["mapping"]).sizes.sum() >= refresh["windows"]["used"]


def refreshes(folder: Path) -> list[Any]:
    return [json.loads(path.read_text()) for path in sorted((folder / "refreshes").glob("*.json"))]


def names(refresh: Any) -> list[int]:
    return [cluster["id"] for cluster in refresh["clusters"]]


def test_clusters_keep_their_names_and_every_change_is_told(run: Path) -> None:
    first, *later = refreshes(run)
    assert first["change"] is None
    assert names(first) == list(range(8))
    assert len(later) >= 1
    before, ever = first, set(names(first))
    for refresh in later:
        change, transition = refresh["change"], refresh["change"]["transition"]
        survived = {one["id"] for one in transition["survived"]}
        assert refresh["mapping"]["ids"] == names(refresh)
        assert change["since_frame"] == before["frame"]
        assert survived | set(transition["emerged"]) == set(names(refresh))
        assert survived | set(transition["vanished"]) == set(names(before))
        assert all(one["overlap"] >= IBEConfig().survival_overlap for one in transition["survived"])
        assert not ever & set(transition["emerged"])
        before, ever = refresh, ever | set(names(refresh))


def in_table(name: str, refresh: Any) -> Any:
    """What metrics.csv calls ``name``, from the file of a refresh."""
    change = refresh["change"]
    short = name.removeprefix("ibe/")
    if name.endswith("_stale"):
        return change["scores_before"][short.removesuffix("_stale")]
    if short in ("survived", "vanished", "emerged"):
        return len(change["transition"][short])
    if short in ("policy_drift", "staleness"):
        return change[short]
    moved = {"vocabulary_drift": "phrase_changed"}.get(short, short)
    if short == "delay_steps":
        return refresh[short]
    told = {"episodes": refresh["episodes"]["used"], "windows": refresh["windows"]["used"]} | refresh["scores"]
    return told[short] if short in told else change["vocabulary_drift"][moved]


def test_metrics_and_the_files_of_the_refreshes_tell_the_same(run: Path) -> None:
    table = {int(row["frames"]): row for row in rows(run)}
    of_the_episode = {"ibe/came_true", "ibe/came_true_stale", "ibe/unknown", "ibe/listens"}
    columns = set(REFRESH_COLUMNS) - {*of_the_episode, "ibe/phrase_changes_per_100", "ibe/flicker"}
    first, *later = refreshes(run)
    assert {name for name in columns if table[first["frame"]][name]} <= {
        *("ibe/episodes", "ibe/windows", "ibe/delay_steps", *(f"ibe/{name}" for name in SCORES))
    }
    for refresh in later:
        row = table[refresh["frame"]]
        for name in columns:
            told = in_table(name, refresh)
            assert row[name] == "" if told is None else float(row[name]) == pytest.approx(told, rel=1e-5), name
        assert 0 <= float(row["ibe/came_true_stale"]) <= 1
        assert 0 <= float(row["ibe/unknown"]) <= 1
        assert Calibration.from_dict(refresh["calibration"]).names == CONFIDENCE_FEATURES
    assert first["calibration"] is None
    assert float(table[first["frame"]]["ibe/unknown"]) == 0  # nothing is calibrated yet
    assert all(row["ibe/came_true"] for row in table.values() if row["ibe/windows"])
    assert not any(row[name] for frame, row in table.items() for name in columns if frame not in told_at(run))


def told_at(folder: Path) -> set[int]:
    return {refresh["frame"] for refresh in refreshes(folder)}


def test_the_probe_is_kept_and_opens_without_running_code(run: Path) -> None:
    with np.load(run / "refreshes" / "probe.npz", allow_pickle=False) as probe:
        delta, observations = probe["delta"], probe["observations"]
    assert delta.shape == (len(delta), 9)
    assert observations.shape == (len(delta), 11)
    assert 8 < len(delta) <= PROBE_WINDOWS
    assert np.isfinite(delta).all()
    assert (observations[:, -1] == 1).all()


def test_a_vocabulary_that_is_not_stale_is_kept(tmp_path: Path) -> None:
    call("train", *SMALL, "refresh_when_stale=1", f"run_dir={tmp_path / 'kept'}", "viewer=off")
    folder = tmp_path / "kept"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["refreshes"] == 1
    assert summary["refreshes_kept"] == 2 - summary["refreshes_skipped"] >= 1
    [only] = refreshes(folder)
    assert sorted(path.name for path in (folder / "refreshes").iterdir()) == [f"{only['frame']:012d}.json", "probe.npz"]
    table = rows(folder)
    assert set(table[0]) >= set(REFRESH_COLUMNS)
    asked = [row for row in table if row["ibe/windows"]]
    assert len(asked) == 1 + summary["refreshes_kept"]
    for row in asked[1:]:
        assert row["ibe/staleness"] != ""
        assert row["ibe/policy_drift"] != ""
        assert [row["ibe/survived"], row["ibe/vocabulary_drift"]] == ["", ""]  # nothing has moved
        for name in {*SCORES} - {OF_THE_MOMENTS}:
            assert row[f"ibe/{name}"] == row[f"ibe/{name}_stale"]
        assert row["ibe/came_true"] == row["ibe/came_true_stale"]


def test_the_log_holds_the_episodes_that_were_flown(run: Path) -> None:
    log = TrajectoryLog.open(run / "trajectories")
    episodes = log.read(range(len(log.index)))
    assert log.frames == 6144
    assert log.episodes_ended == len(episodes) == json.loads((run / "summary.json").read_text())["episodes"]
    for episode in episodes:  # what the log says the instructor said is what the rule says
        expected = np.sign(episode.states[:-1, 8] - episode.states[:-1, 0])
        expected[np.abs(episode.states[:-1, 8] - episode.states[:-1, 0]) <= np.float32(0.2)] = 0
        np.testing.assert_array_equal(episode.instructions[:, 0], expected)


def test_the_recording_is_whole(run: Path) -> None:
    chunks = list(RrdReader(str(run / "recording.rrd")).stream())
    assert sum(chunk.to_record_batch().num_rows for chunk in chunks) > 100
    assert_whole(run / "recording.rrd")


def test_the_recording_holds_what_metrics_and_refreshes_hold(run: Path) -> None:
    recorded, table = read(run / "recording.rrd"), rows(run)
    columns = [name for name in table[0] if name.split("/")[0] in ("train", "eval", "ibe")]
    assert len(columns) > 20
    for name in columns:
        expected = {int(row["frames"]): float(row[name]) for row in table if row[name]}
        found = recorded.get(f"/curves/{name}", [])
        values = np.ravel(column(found, "Scalars:scalars"))
        assert dict(zip(frames(found), values, strict=True)) == pytest.approx(expected, rel=1e-5), name
    refreshes = [json.loads(path.read_text()) for path in sorted((run / "refreshes").glob("*.json"))]
    assert frames(recorded["/vocabulary/centres"]) == [saved["frame"] for saved in refreshes]
    for saved in refreshes:
        [names] = [row for row in recorded["/vocabulary/names"] if row.get("frames") == saved["frame"]]
        labels = [f"#{cluster['id']} {cluster['expression'][0]:+.2f}" for cluster in saved["clusters"]]
        assert names["Points2D:labels"] == labels


def test_the_same_seed_gives_the_same_numbers(run: Path, tmp_path: Path) -> None:
    call("train", *SMALL, *TWO_SPANS, ASSUMED, f"run_dir={tmp_path / 'again'}", "viewer=off")
    for first, second in zip(rows(run), rows(tmp_path / "again"), strict=True):
        for name in first:
            if not name.startswith("time/"):
                assert first[name] == second[name], name
    for path in (run / "refreshes").glob("*.json"):
        assert path.read_text() == (tmp_path / "again" / "refreshes" / path.name).read_text()
    assert not (tmp_path / "again" / "recording.rrd").exists()


def test_explain_tells_an_episode_of_a_run(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("explain", f"run={run}", "seed=7", "context=right")
    said = capsys.readouterr().out
    assert re.match("GOOD|WEAK|REVERSED|UNKNOWN|The AUC for the direction of motion cannot be measured", said)
    assert re.search(r"^Lunar Lander with pads: right, ", said, re.MULTILINE)
    assert "to the right" in said
    assert "went as predicted" in said
    recording = run / "explanations" / "episode_seed7_right.rrd"
    assert recording.is_file()
    assert str(recording) in said


def said_of_spans(output: str) -> list[tuple[str, ...]]:
    """What the agent says of ten and of twenty steps, a pair a row."""
    rows = [line.strip() for line in output.splitlines() if re.match(r" +\d+(-\d+)?  ", line)]
    return [tuple(re.split(" {2,}", row)[2:4]) for row in rows]


def test_explain_tells_what_is_said_of_each_span_of_time(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    call("explain", f"run={run}", "seed=3", "viewer=off", "min_confidence=0")
    wide = capsys.readouterr().out
    assert "of its explanations of the next 20 steps went as predicted" in wide.splitlines()[-1]
    assert re.search("next 10 steps +next 20 steps", wide)
    spoken = said_of_spans(wide)
    assert {len(both) for both in spoken} == {2}
    monkeypatch.setenv("COLUMNS", "80")
    call("explain", f"run={run}", "seed=3", "viewer=off", "min_confidence=0")
    narrow = capsys.readouterr().out
    assert "…" not in narrow
    assert max(len(line) for line in narrow.splitlines()[:-1]) <= 120


def test_explain_does_not_say_what_the_agent_is_not_sure_of(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    call("explain", f"run={run}", "seed=7", "viewer=off", "min_confidence=1")  # which no probability is
    spoken = said_of_spans(capsys.readouterr().out)
    assert spoken
    assert {far for _, far in spoken} == {DOES_NOT_KNOW}
    assert DOES_NOT_KNOW not in {near for near, _ in spoken}  # only twenty steps are calibrated


def test_explain_takes_the_newest_run(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "runs").mkdir()
    shutil.copytree(run, tmp_path / "runs" / "old" / "nested")
    os.utime(tmp_path / "runs" / "old" / "nested" / ".hydra" / "config.yaml", (0, 0))
    shutil.copytree(run, tmp_path / "runs" / "new")
    (tmp_path / "runs" / "old" / "nested" / "checkpoints" / "policy_000000006144.pt").write_text("not the one")
    monkeypatch.chdir(tmp_path)
    call("explain", "viewer=off", "seed=1")
    assert "Policy of frame 6,144" in capsys.readouterr().out.replace("\n", " ")


def test_a_refresh_that_cannot_be_made_is_skipped_counted_and_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "silent"
    call("train", *SMALL, "instructor=silent", f"run_dir={folder}", "viewer=file")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["refreshes"], summary["refreshes_skipped"]) == (0, 3)
    assert "refresh skipped" in capsys.readouterr().out
    assert [row["ibe/skipped"] for row in rows(folder) if row["ibe/skipped"]] == ["1", "2", "3"]


def test_a_horizon_that_nobody_set_is_found_told_once_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["mapping.horizon_steps=null", "mapping.spans_steps=[10]", "predictor=regression", "viewer=off"]
    call("train", *SMALL, *settings, f"run_dir={tmp_path / 'found'}")
    saved = [json.loads(path.read_text()) for path in (tmp_path / "found" / "refreshes").glob("*.json")]
    [steps] = {each["horizon_steps"] for each in saved}
    assert json.loads((tmp_path / "found" / "summary.json").read_text())["horizon_steps"] == steps
    assert 10 < steps < 40  # a fifth of short flights
    told = capsys.readouterr().out
    line = f"explains the next {steps} steps, as long as movements last here; mapping.horizon_steps sets it"
    assert told.count(line) == told.count("explains the next") == 1
    assert load_run(tmp_path / "found").horizon_steps == steps
    call("explain", f"run={tmp_path / 'found'}", "viewer=off", "predictor=regression")
    assert f"of the next {steps} steps" in capsys.readouterr().out


def test_it_is_said_what_can_be_done_if_refresh_after_refresh_is_skipped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    always = ["mapping.horizon_steps=900", "mapping.window_end=drop"]  # no episode is that long
    call("train", *SMALL, *always, f"run_dir={tmp_path / 'many'}", "viewer=off")
    told = capsys.readouterr().out.replace("\n", " ")
    assert "2 refreshes were skipped so far and there are no words yet: train longer, use mapping=lasso" in told
    assert "1 refreshes" not in told


def test_early_refreshes_without_whole_episodes_do_not_stop_training(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call(
        "train",
        *SMALL,
        "total_frames=2000",
        "mapping.horizon_steps=900",
        "mapping.window_end=drop",
        f"run_dir={tmp_path / 'long'}",
        "viewer=off",
    )
    assert "no window of 900 steps" in capsys.readouterr().out


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        yield int(holder.getsockname()[1])


BAD = {
    "misspelt": (["mapping.n_clustrs=4"], ["mapping.n_clustrs", "n_clusters"]),
    "unknown key": (["colour=red"], ["colour", "total_frames"]),
    "added key": (["+mapping.colour=red"], ["mapping.colour", "n_clusters"]),
    "other agent's key": (["agent=dqn", "agent.clip=0.1"], ["agent.clip", "epsilon_end"]),
    "unknown choice": (["agent=sarsa"], ["agent=sarsa", "dqn, ppo"]),
    "unknown mapping": (["mapping=magic"], ["mapping=magic", "paper"]),
    "not a number": (["mapping.horizon_steps=abc"], ["mapping.horizon_steps", "abc"]),
    "nothing on top": (["mapping.top_fraction=0"], ["mapping.top_fraction=0", "at most 1"]),
    "more than all": (["mapping.top_fraction=1.5"], ["mapping.top_fraction=1.5", "at most 1"]),
    "one cluster": (["mapping.n_clusters=1"], ["mapping.n_clusters=1", "at least 2"]),
    "no horizon": (["mapping.horizon_steps=0"], ["mapping.horizon_steps=0", "at least 1"]),
    "too long a horizon": (["mapping.horizon_steps=1001"], ["mapping.horizon_steps=1001", "at most 1000"]),
    "unknown dimension": (["mapping.dimensions=[height]"], ["mapping.dimensions=['height']", "angle"]),
    "words turn elsewhere": (
        ["mapping.dimensions=[angle]"],
        ["mapping.dimensions=['angle']", "it reads x, goal_x; allowed is [], or mapping=lasso"],
    ),
    "no newest frames": (["mapping.newest_frames=0"], ["mapping.newest_frames=0", "at least 1"]),
    "no span": (["mapping.spans_steps=[20,0]"], ["mapping.spans_steps=[20, 0]", "at least 1 and at most 1000"]),
    "movement without an axis": (
        ["mapping=paper", "mapping.normalisation=movement"],
        ["mapping.normalisation=movement", "minmax, sign"],
    ),
    "halving with memory": (["mapping.split=bisecting"], ["mapping.memory=0.5", "allowed is null"]),
    "a space that is none": (["mapping.space=outer"], ["mapping.space=outer", "network, rule"]),
    "memory without end": (["mapping.memory=1"], ["mapping.memory=1.0", "at most 0.99"]),
    "less than no memory": (["mapping.memory=-0.1"], ["mapping.memory=-0.1", "at least 0"]),
    "anything survives": (["mapping.survival_overlap=0"], ["mapping.survival_overlap=0", "above 0 and at most 1"]),
    "nothing survives": (["mapping.survival_overlap=1.1"], ["mapping.survival_overlap=1.1", "at most 1"]),
    "held backwards": (["mapping.hold_within=-0.1"], ["mapping.hold_within=-0.1", "at least 0 and at most 2"]),
    "held for ever": (["mapping.hold_within=2.5"], ["mapping.hold_within=2.5", "at most 2"]),
    "never stale": (["refresh_when_stale=1.5"], ["refresh_when_stale=1.5", "at least -1 and at most 1"]),
    "stale is no number": (["refresh_when_stale=often"], ["refresh_when_stale", "often"]),
    "a setting that is gone": (["mapping.warm_start=true"], ["mapping.warm_start", "memory"]),
    "unknown environment": (["env.id=Mars-v0"], ["env.id=Mars-v0", "ibe_rl/LunarLanderPads-v0"]),
    "other environment": (["env.id=CartPole-v1"], ["env.id=CartPole-v1", "'pad'"]),
    "wrong pad": (["env.kwargs.pad=middle"], ["env.kwargs", "middle", "center"]),
    "stale without a look": (
        ["refresh_every_frames=null", "refresh_when_stale=0.1"],
        ["refresh_when_stale=0.1", "allowed is null"],
    ),
    "surer than sure": (["min_confidence=1.1"], ["min_confidence=1.1", "at least 0 and at most 1"]),
    "no future": (["predictor.futures=0"], ["predictor.futures=0", "at least 1 and at most 100"]),
    "wrong viewer": (["viewer=tv"], ["viewer=tv", "file, live, off"]),
    "ahead of nothing": (["collect.ahead_batches=3"], ["collect.ahead_batches=3", "collect.overlap=false", "is 1, or"]),
    "blind to what is not there": (["agent.ignores=[goal]"], ["agent.ignores=goal:", "goal_x"]),
    "obeying nobody": (
        ["instructor=silent", "obedience.judge=oracle"],
        ["obedience.judge=oracle", "instructor=silent"],
    ),
    "taught in two places": (["instructor=human", "collect.processes=2"], ["collect.processes=2", "instructor=human"]),
    "taught by nobody": (["instructor=recorded", "instructor.recording=no_run"], ["recording=no_run", "lesson.jsonl"]),
    "no such port": (["viewer=live", "viewer.web_port=70000"], ["viewer.web_port=70000", "65535"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings_end_in_one_line_before_anything_is_made(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    overrides, expected = BAD[case]
    with pytest.raises(SystemExit) as stopped:
        call("train", f"run_dir={tmp_path / 'run'}", *overrides)
    message = str(stopped.value.code)
    assert message.startswith("error: ")
    assert "\n" not in message
    for part in expected:
        assert part in message
    assert not (tmp_path / "run").exists()
    assert capsys.readouterr().err == ""


def test_a_port_asked_for_by_number_and_taken_is_refused(taken_port: int, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=f"viewer.grpc_port={taken_port}: taken"):
        call("train", f"run_dir={tmp_path / 'run'}", "viewer=live", f"viewer.grpc_port={taken_port}")


def test_a_folder_that_holds_a_run_is_left_alone(run: Path) -> None:
    before = (run / "metrics.csv").read_bytes(), (run / ".hydra" / "config.yaml").read_bytes()
    with pytest.raises(SystemExit, match="holds a run already"):
        call("train", *SMALL, f"run_dir={run}", "viewer=off")
    assert before == ((run / "metrics.csv").read_bytes(), (run / ".hydra" / "config.yaml").read_bytes())


@pytest.mark.parametrize("extra", [[], ["-m", "seed=0,1"]])
def test_a_folder_that_cannot_be_written_is_refused(extra: list[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(SystemExit, match=r"error: run_dir=.*can be written to"):
        call("train", *extra, f"run_dir={tmp_path / 'file' / 'run'}", "viewer=off")


@pytest.mark.parametrize("setting", ["runs_at_once=2", "runs_on=there:1"])
def test_a_setting_of_sweeps_is_refused_for_one_run(setting: str, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=rf"error: .*{setting}.*: allowed only in a sweep \(-m\)"):
        call("train", setting, f"run_dir={tmp_path / 'run'}", "viewer=off")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["run=nowhere"], "run=nowhere: not a run folder"),
        (["context=middle"], "context=middle: allowed is one of left, center, right"),
        (["task=dance"], "task=dance: allowed is one of episode, evaluate, compare"),
        (["task=evaluate", "evaluate.episodes=1"], "evaluate.episodes=1: allowed is at least 2 and at most 10000"),
        (
            ["task=evaluate", "evaluate.horizons_steps=[20,0]"],
            r"evaluate.horizons_steps=\[20, 0\]: allowed is at least 1",
        ),
        (["task=evaluate", "evaluate.episods=2"], "evaluate.episods: no such setting; allowed are .*episodes"),
        (["task=compare", "compare.mappings=[magic]"], r"compare.mappings=\['magic'\]: allowed are .*paper"),
        (["pad=left"], "pad: no such setting; allowed are .*context"),
        (["min_confidence=-0.1"], "min_confidence=-0.1: allowed is at least 0 and at most 1"),
        (["predictor.futures=0"], "predictor.futures=0: allowed is at least 1 and at most 100"),
        (["task=evaluate", "+evaluate.futures=2"], "evaluate.futures=2: no such setting; allowed are .*episodes"),
        (["output=/dev/null/x.rrd"], "output=/dev/null/x.rrd: allowed is a file that can be written"),
    ],
)
def test_explain_refuses_in_one_line(run: Path, overrides: list[str], expected: str) -> None:
    given = overrides if overrides[0].startswith("run=") else [f"run={run}", *overrides]
    with pytest.raises(SystemExit, match=f"^error: {expected}"):
        call("explain", *given)


@pytest.mark.parametrize("task", ["evaluate", "compare", "predictors"])
def test_a_run_without_a_log_is_not_judged(task: str, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("trajectories"))
    with pytest.raises(SystemExit, match=r"^error: run=.*: it has no log \(trajectories/\) to learn other vocab"):
        call("explain", f"run={tmp_path / 'run'}", f"task={task}")
    assert not (tmp_path / "run" / "evaluation").exists()


@pytest.mark.parametrize("task", ["evaluate", "compare"])
def test_a_run_without_a_vocabulary_is_not_judged(task: str, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("*.json"))
    with pytest.raises(SystemExit, match=r"^error: run=.*: it has no vocabulary from before its policy"):
        call("explain", f"run={tmp_path / 'run'}", f"task={task}")


FEW = [
    *("evaluate.episodes=6", "evaluate.calibration_episodes=4", "evaluate.changing_episodes=3", "evaluate.shuffles=3"),
    "evaluate.spoken_episodes=1",
    *("predictor.futures=2", "evaluate.resamples=40", "predictor.processes=1", "evaluate.horizons_steps=[20,40]"),
]


@pytest.fixture(scope="module")
def judged(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("judged") / "run"
    shutil.copytree(run, folder)
    call("explain", f"run={folder}", "task=evaluate", *FEW)
    return folder


def test_what_the_agent_says_is_judged(judged: Path) -> None:
    quality = json.loads((judged / "evaluation" / "quality.json").read_text())
    protocol, table = quality["protocol"], quality["rows"]
    assert (protocol["episodes"], protocol["horizon_steps"], protocol["stride"]) == (6, 20, 4)
    assert protocol["seeds"]["judged"] == [2_050_000_000, 2_050_000_005]
    ours = f"ibe:{json.loads((judged / 'summary.json').read_text())['mapping']}"
    for steps in (20, 40):
        names = {row["explainer"]: row for row in table if row["horizon_steps"] == steps}
        assert names.keys() >= {ours, *(f"baseline:{name}" for name in BASELINES)}
        assert names["baseline:true_future"]["motion_auc"]["value"] in (1, None)
        assert names["baseline:constant"]["motion_auc"]["value"] in (0.5, None)
    assert {row["policy_frame"] for row in quality["changing_policy"]} == {3072, 6144}
    assert any(each["best_cheap"] for each in quality["paired"])
    assert (quality["spoken"]["episodes"], len(quality["spoken"]["rows"])) == (1, 3)
    with (judged / "evaluation" / "moments.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == protocol["moments"]
    assert {path.name for path in (judged / "evaluation").iterdir()} == {
        *("quality.json", "observers.json", "calibration.json", "moments.csv")
    }
    calibration = load_run(judged).calibration
    assert calibration is not None
    told = json.loads((judged / "evaluation" / "calibration.json").read_text())
    assert calibration.to_dict() == told["spoken"]  # what the agent speaks with from now on
    assert {path.name for path in (judged / "figures").iterdir()} == {
        *("quality.png", "confidence.png", "horizons.png", "changing_policy.png")
    }


BASELINES = ("present_velocity", "direction_to_goal", "last_instruction", "state_regressor", "predicted_change")
BASELINES += ("constant", "paper", "flipped", "shuffled", "true_future", "random_clusters", "random_names")
BASELINES += ("another_moment",)


def test_the_same_judgement_twice(judged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(judged, tmp_path / "run")
    call("explain", f"run={tmp_path / 'run'}", "task=evaluate", *FEW, "evaluate.changing_episodes=0")
    first, again = (
        json.loads((folder / "evaluation" / "quality.json").read_text()) for folder in (judged, tmp_path / "run")
    )
    assert again["rows"] == first["rows"]
    assert again["changing_policy"] == []
    said = capsys.readouterr().out
    assert "6 unseen episodes" in said
    assert max(len(line) for line in said.splitlines() if not line.startswith(("numbers:", "figures:"))) <= 130


def test_mappings_are_compared_on_the_same_log(judged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("explain", f"run={judged}", "task=compare", *FEW, "compare.mappings=[paper_sign,lasso]")
    compared = json.loads((judged / "evaluation" / "compare.json").read_text())
    names = {row["explainer"] for row in compared["rows"]}
    assert names >= {"ibe:as_refreshed", "ibe:paper_sign", "ibe:lasso", "baseline:paper", "baseline:predicted_change"}
    assert "ibe:axis" not in names
    assert {row["horizon_steps"] for row in compared["rows"]} == {20}
    assert "mappings learnt from its log" in capsys.readouterr().out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_a_terminal_or_a_batch_system_sends_ends_a_live_run_in_order(number: int, tmp_path: Path) -> None:
    folder = tmp_path / "stopped"
    many = ["collect.processes=2", "total_frames=100000000"]
    script = start("train.py", *SMALL, *many, f"run_dir={folder}", "viewer=live")
    assert eventually(lambda: list((folder / "refreshes").glob("*.json")) or script.poll() is not None)
    assert script.poll() is None, script.stdout.read() if script.stdout else ""
    script.send_signal(number)
    os.killpg(script.pid, number)  # to the whole group, as a terminal does; `timeout` sends both
    output, _ = script.communicate(timeout=240)
    assert script.returncode == 0, output
    assert "live view: http://127.0.0.1" in output
    assert "ssh -L" in output
    assert f"-m ibe_rl.viewer {folder}" in output
    assert "Traceback" not in output
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["stopped_early"] is True
    assert summary["frames"] == int(rows(folder)[-1]["frames"])
    assert (folder / "checkpoints" / f"policy_{summary['frames']:012d}.pt").is_file()
    assert_whole(folder / "recording.rrd")


def test_importing_ibe_brings_no_torch() -> None:
    code = "import ibe_rl, sys; from ibe_rl import IBEMapping; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_predictors_are_held_against_the_exact_one(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(shutil.copytree(run, tmp_path / "run"))
    call(
        "explain", f"run={folder}", "task=predictors", *FEW, "evaluate.changing_episodes=0", "evaluate.stride_steps=20"
    )
    told = json.loads((folder / "evaluation" / "predictors.json").read_text())
    rows = {row["predictor"]: row for row in told["rows"]}
    assert list(rows) == ["simulator", "simulator_again", "ensemble", "regression"]
    assert rows["simulator"]["equal"]["value"] == rows["simulator"]["trusted"]["value"] == 1
    assert rows["simulator"]["motion_auc_minus_exact"]["value"] == 0
    assert len({row["moments"] for row in rows.values()}) == 1
    assert 0 < rows["ensemble"]["equal"]["value"] <= 1
    assert (folder / "figures" / "predictors.png").stat().st_size > 10_000
    assert "if trusted" in capsys.readouterr().out


def test_the_speed_of_predictors_is_measured(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(foreseeing.KINDS, "ensemble", EnsembleConfig(updates=2))
    found = foreseeing.rates(str(run), 30, 10)
    assert set(found) == {f"{kind}{what}" for kind in foreseeing.KINDS for what in ("", "_learns_s")}
    assert all(rate > 0 for kind, rate in found.items() if not kind.endswith("_learns_s"))


def test_predictors_are_held_against_a_policy_that_the_log_does_not_know(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(foreseeing.KINDS, "ensemble", EnsembleConfig(updates=2))
    few = EvaluateConfig(episodes=2, calibration_episodes=2, stride_steps=25, resamples=20)
    rows = foreseeing.for_another_policy(load_run(run), 1, few)
    assert [row["predictor"] for row in rows] == ["simulator", "simulator_again", "ensemble", "regression"]
    assert {(row["frame"], row["policy_frame"] < 6_144) for row in rows} == {(6_144, True)}


def test_a_run_is_explained_with_the_predictor_that_it_learnt(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, asked = Path(shutil.copytree(run, tmp_path / "run")), list[str]()
    monkeypatch.setattr(explain, "explain_episode", lambda _, cfg: asked.append(cfg.predictor.kind))
    call("explain", f"run={folder}")
    settings = folder / ".hydra" / "config.yaml"
    settings.write_text(settings.read_text().replace("kind: simulator", "kind: ensemble"))
    call("explain", f"run={folder}")
    call("explain", f"run={folder}", "predictor=simulator")
    assert asked == ["simulator", "ensemble", "simulator"]


@pytest.mark.parametrize("kind", ["ensemble", "regression"])
def test_an_episode_is_explained_by_what_is_learnt_from_the_log(kind: str, run: Path) -> None:
    learnt = ["predictor.updates=5"] if kind == "ensemble" else []
    call("explain", f"run={run}", f"predictor={kind}", "viewer=off", *learnt)
