"""The benchmark of flawed instructors: what is measured and what is kept; nothing is trained or flown."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks import robustness
from benchmarks.robustness_report import anew_table
from ibe_rl.instructors.flawed import FlawedConfig
from ibe_rl.storage.run_folder import read_json, write_json

RUN_OF_3 = {"frames": 600, "wall_s": 1.5}
"""The summary of a run; another training takes another time."""


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """Two curves of two points and two flawed instructors; nothing is trained or flown. Returns what would be done."""
    done: list[Any] = []
    run = SimpleNamespace(config=SimpleNamespace(seed=3, total_frames=600), mapping=None)
    flaws = FlawedConfig(late_steps=9)
    monkeypatch.setattr(robustness, "CURVES", {name: {"0": FlawedConfig(), "9": flaws} for name in ("late", "wrong")})
    monkeypatch.setattr(robustness, "ANEW", {"later": (("instructor=flawed",), flaws), "never": ((), FlawedConfig())})

    @contextmanager
    def trained(seed: int, _: Any, *overrides: str) -> Iterator[Any]:
        done.append((seed, *overrides))
        yield run, None

    def load_run(folder: Path) -> Any:
        done.append(folder.name)
        return run

    def losses(_run: Any, _moments: Any, flaws: FlawedConfig, draw: int) -> dict[str, Any]:
        done.append("corrupted")
        return {"late": flaws.late_steps, "own": 0.1 * draw, "paper": None}

    for replaced in (trained, load_run, losses):
        monkeypatch.setattr(robustness, replaced.__name__, replaced)
    monkeypatch.setattr(robustness, "fly", lambda *_: None)
    monkeypatch.setattr(robustness, "delay_of", lambda _: None)
    monkeypatch.setattr(robustness, "loss_of", lambda *_: 0.25)
    monkeypatch.setattr(robustness, "write_report", lambda *_: None)
    for name in ("ppo0", "ppo1"):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / "summary.json", RUN_OF_3)
    return done


LATER, NEVER = (3, "total_frames=600", "instructor=flawed"), (3, "total_frames=600")
"""Trainings with the seed and frames of the run whose log was corrupted."""


def test_flawed_trainings_are_compared_with_runs_that_are_there(by_hand: list[Any], tmp_path: Path):
    asked = ["--corruptions", "1", "--output", str(tmp_path), "--runs", str(tmp_path / "ppo0")]
    robustness.main([*asked, "--anew"])
    assert by_hand == ["ppo0", *["corrupted"] * 6, LATER, NEVER]
    found = read_json(tmp_path / "robustness.json")
    assert [(one["seed"], one["curve"], one["point"], one["draw"], one["own"]) for one in found["curves"]] == [
        (0, curve, point, 0, 0.0) for curve in ("late", "wrong") for point in ("0", "9")
    ]
    one, _ = found["anew"]
    assert (one["run"], one["seed"]) == ("ppo0, 600 frames in 1.500 s, 100 episodes", 3)
    assert anew_table(found["anew"])[2:] == ["| later | 3 | 0.250 | 0.000 | - |", "| never | 3 | 0.250 | 0.000 | - |"]
    robustness.main(asked)  # corrupted only: what was trained anew stays
    assert by_hand[9:] == ["ppo0", *["corrupted"] * 4]
    assert read_json(tmp_path / "robustness.json")["anew"] == found["anew"]


def test_what_was_measured_is_kept(by_hand: list[Any], tmp_path: Path):
    results, runs = tmp_path / "robustness.json", [str(tmp_path / name) for name in ("ppo0", "ppo1")]
    asked = ["--missing", "--anew", "--corruptions", "1", "--output", str(tmp_path), "--runs"]
    robustness.main([*asked, *runs])
    found = read_json(results)

    def again(*runs: str) -> list[Any]:
        by_hand.clear()
        robustness.main([*asked, *runs])
        return by_hand

    assert again(*runs) == []
    assert read_json(results) == found
    write_json(results, found | {"anew": found["anew"][:-1]})
    assert again(*runs) == [NEVER]
    write_json(results, found | {"curves": found["curves"][1:]})  # a point lacks: its curve is measured again
    assert again(*runs) == ["ppo0", "corrupted", "corrupted"]
    assert again(runs[1]) == []
    assert {one["seed"] for one in read_json(results)["curves"]} == {0}  # by its place among those that are asked for
    write_json(tmp_path / "ppo1" / "summary.json", RUN_OF_3 | {"wall_s": 1.501})
    assert again(runs[1]) == ["ppo1", *["corrupted"] * 6, LATER, NEVER]
    assert len(read_json(results)["curves"]) == 4


def test_what_is_stopped_goes_on(by_hand: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    asked = ["--missing", "--seeds", "4", "--corruptions", "2", "--output", str(tmp_path)]
    train_anew = robustness.train_anew
    monkeypatch.setattr(robustness, "train_anew", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        robustness.main(asked)
    assert by_hand == [(4,), *["corrupted"] * 10]
    by_hand.clear()
    monkeypatch.setattr(robustness, "train_anew", train_anew)
    robustness.main(asked)
    assert by_hand == [LATER, NEVER]
    robustness.main(asked[1:])
    assert by_hand[2:] == [(4,), *["corrupted"] * 10, LATER, NEVER]


@pytest.mark.parametrize(("text", "why"), [("{}", "KeyError: 'frames'"), ("[", "JSONDecodeError"), (None, "FileNotF")])
def test_a_run_that_is_not_finished_is_refused(text: str | None, why: str, by_hand: list[Any], tmp_path: Path):
    (tmp_path / "ppo0" / "summary.json").unlink()
    if text is not None:
        (tmp_path / "ppo0" / "summary.json").write_text(text)
    expected = rf"ppo0: allowed is the folder of a finished run \(summary\.json: {why}"
    with pytest.raises(SystemExit, match=expected):
        robustness.main(["--output", str(tmp_path), "--runs", str(tmp_path / "ppo0")])
    assert by_hand == []


def test_a_report_of_nothing_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        robustness.main(["--report", "--output", str(tmp_path)])
    assert (
        f"allowed once something was measured ({tmp_path / 'robustness.json'} is not there)" in capsys.readouterr().err
    )
