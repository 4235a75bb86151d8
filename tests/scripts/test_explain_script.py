"""What explain.py tells of a run."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest
from processes import call

from ibe_rl.types import DOES_NOT_KNOW


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
