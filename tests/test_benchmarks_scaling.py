"""The tables of the scaling benchmark, by hand, and its smallest measurements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks import scaling, scaling_report
from benchmarks.child import measure
from benchmarks.scaling_report import collection, limits, training, write_report

pytestmark = pytest.mark.slow

ALONE = scaling.ALONE
ABOUT = {
    "date": "2026-01-02 03:04 UTC",
    "versions": {"python": "3.11.1", "ray": "2.60.0"},
    "machine": {"processor": "A processor", "cores": 2, "memory_gb": 8.0},
}


def one_round(alone: float, two: float) -> dict[str, Any]:
    shares = {"collect": 0.5, "learn": 0.4, "log": 0.1}
    arms = {ALONE: alone, "2 processes": two, "1 process of its own": alone / 2, "Ray, 1 worker": alone / 4}
    return {
        "inside": {"games": 0.75, "policy": 0.15, "collector": 0.1},
        "collect": arms,
        "train": {name: {"frames_per_s": rate, "learning_s": 50.0, "shares": shares} for name, rate in arms.items()},
    }


ROUNDS = [one_round(1000, 1500), one_round(2000, 4000), one_round(1000, 1800)]


def test_ratios_are_of_the_same_round_and_the_middle_one_counts():
    assert collection(ROUNDS)[2:4] == [
        f"| {ALONE} | 1,000 | 1.00 | 1.00 to 1.00 |",
        "| 2 processes | 1,800 | 1.80 | 1.50 to 2.00 |",
    ]
    assert training(ROUNDS)[3] == "| 2 processes | 1,800 | 1.80 | 1.50 to 2.00 | 50% | 40% | 10% |"


def test_what_limits_is_said():
    lines = limits(ROUNDS)
    assert "| the games and their instructor | 75% |" in lines
    assert "| 1 process of its own | 50% |" in lines
    assert "| Ray, 1 worker | 75% |" in lines
    assert lines[-1].endswith("takes 50.0 s a million frames: at most 20,000 frames/s, however many workers there are.")


def test_the_tables_have_their_places_in_the_page(tmp_path: Path):
    write_report({"about": ABOUT, "rounds": ROUNDS}, tmp_path)
    text = (tmp_path / "SCALING.md").read_text()
    assert "Measured 2026-01-02 03:04 UTC, 3 rounds, A processor, 2 cores, 8.0 GB" in text
    page = scaling_report.PAGE.read_text()
    for part in ("conditions", "collection", "training", "limits"):
        assert f"<!-- {part}: python -m benchmarks.scaling -->" in page
        assert f"<!-- end of {part} -->" in page


def test_every_arm_has_as_many_environments():
    for settings in (*scaling.COLLECT.values(), *scaling.TRAIN.values()):
        made = scaling.sized(settings)
        assert made["processes"] * made["envs_per_process"] == scaling.ROWS


def test_without_ray_it_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(scaling, "find_spec", lambda _: None)
    with pytest.raises(SystemExit):
        scaling.main([])
    assert "Ray is not installed" in capsys.readouterr().err


def test_the_time_inside_a_collector_is_shared_out():
    settings = {"processes": 1, "envs_per_process": 4, "steps_per_batch": 64}
    shares = measure("stepping.inside", settings=settings, count=2)
    assert sum(shares.values()) == pytest.approx(1)
    assert all(share > 0.01 for share in shares.values())
    assert shares["games"] > shares["policy"] * 0.5
