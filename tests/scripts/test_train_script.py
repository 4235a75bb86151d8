"""What train.py leaves behind: small runs of the real thing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from itertools import islice, takewhile
from pathlib import Path

import numpy as np
import pytest
from processes import SMALL, SMALL_RUN, assert_whole, call, start
from rerun.chunk import RrdReader
from view_data import column, eventually, frames, read

from ibe_rl.collect.collector import Batches
from ibe_rl.storage.log import TrajectoryLog
from ibe_rl.storage.run_folder import METRICS, read_rows
from ibe_rl.training.run import TIMES

SUMMARY_KEYS = {
    *("frames", "wall_s", "frames_per_s", "episodes", "success_rate", "return_mean", "refreshes"),
    *("refreshes_kept", "refreshes_skipped", "time_s", "meaning", "notes", "seed", "agent", "mapping", "versions"),
}


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
    table = read_rows(run / METRICS)
    assert next(iter(table[0])) == "frames"
    assert [int(row["frames"]) for row in table] == [1024 * (i + 1) for i in range(6)]
    assert [bool(row["eval/success_rate"]) for row in table] == [False, False, True, False, False, True]
    assert {name.split("/")[0] for name in table[0]} == {"frames", "train", "eval", "ibe", "time"}


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
    recorded, table = read(run / "recording.rrd"), read_rows(run / METRICS)
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
    call("train", *SMALL_RUN, f"run_dir={tmp_path / 'again'}", "viewer=off")
    assert numbers(run) == numbers(tmp_path / "again")
    for path in (run / "refreshes").glob("*.json"):
        assert path.read_text() == (tmp_path / "again" / "refreshes" / path.name).read_text()
    assert not (tmp_path / "again" / "recording.rrd").exists()


def numbers(run: Path) -> list[dict[str, str]]:
    """All rows of metrics.csv, without how long anything took."""
    return [
        {name: text for name, text in row.items() if not name.startswith("time/")} for row in read_rows(run / METRICS)
    ]


def test_workers_collect_while_the_vocabulary_is_learnt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of it changes: the agent learns nothing meanwhile. After the last batch there is nothing to collect."""
    settings, asked, collect_next = [*SMALL_RUN, "collect.processes=2", "viewer=off"], [], Batches.collect_next
    monkeypatch.setattr(Batches, "collect_next", lambda batches: asked.append(collect_next(batches)))
    call("train", *settings, f"run_dir={tmp_path / 'meanwhile'}")
    found = numbers(tmp_path / "meanwhile")
    assert len(asked) == 2
    assert sum(bool(row["ibe/windows"]) for row in found) == 3
    monkeypatch.setattr(Batches, "collect_next", lambda _: None)
    call("train", *settings, f"run_dir={tmp_path / 'later'}")
    assert found == numbers(tmp_path / "later")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_a_terminal_or_a_batch_system_sends_ends_a_live_run_in_order(number: int, tmp_path: Path) -> None:
    folder = tmp_path / "stopped"
    many = ["collect.processes=2", "total_frames=100000000"]
    script = start("train.py", *SMALL, *many, f"run_dir={folder}", "viewer=live")
    assert eventually(lambda: list((folder / "refreshes").glob("*.json")) or script.poll() is not None)
    lines = islice(iter(script.stdout.readline, ""), 1000)
    before = [*takewhile(lambda line: "live view: http://127.0.0.1" not in line, lines)]
    assert script.poll() is None, before
    script.send_signal(number)
    os.killpg(script.pid, number)  # to the whole group, as a terminal does; `timeout` sends both
    output, _ = script.communicate(timeout=240)
    assert script.returncode == 0, output
    assert "ssh -L" in output
    assert f"-m ibe_rl.viewer {folder}" in output
    assert "Traceback" not in output
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["stopped_early"] is True
    assert summary["frames"] == int(read_rows(folder / METRICS)[-1]["frames"])
    assert (folder / "checkpoints" / f"policy_{summary['frames']:012d}.pt").is_file()
    assert_whole(folder / "recording.rrd")


def test_importing_ibe_brings_no_torch() -> None:
    code = "import ibe_rl, sys; from ibe_rl import IBEMapping; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
