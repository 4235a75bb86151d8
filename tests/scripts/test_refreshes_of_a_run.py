"""What train.py keeps and tells of each refresh."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import SMALL, call

from ibe_rl.config.saved import load_config
from ibe_rl.config.settings import TrainConfig
from ibe_rl.evaluation.runs import load_run
from ibe_rl.explain.phrasing import CONFIDENCE_FEATURES
from ibe_rl.ibe import ClusterMapping, IBEConfig, normalise
from ibe_rl.metrics.confidence import Calibration
from ibe_rl.metrics.quality import OF_THE_MOMENTS, SCORES
from ibe_rl.storage.run_folder import CONFIG, METRICS, read_rows
from ibe_rl.vocabulary.probe import PROBE_WINDOWS
from ibe_rl.vocabulary.refresh_columns import REFRESH_COLUMNS


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
    table = {int(row["frames"]): row for row in read_rows(run / METRICS)}
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
    table = read_rows(folder / METRICS)
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


def test_a_refresh_that_cannot_be_made_is_skipped_counted_and_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "silent"
    call("train", *SMALL, "instructor=silent", f"run_dir={folder}", "viewer=file")
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["refreshes"], summary["refreshes_skipped"]) == (0, 3)
    assert "refresh skipped" in capsys.readouterr().out
    assert [row["ibe/skipped"] for row in read_rows(folder / METRICS) if row["ibe/skipped"]] == ["1", "2", "3"]


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
