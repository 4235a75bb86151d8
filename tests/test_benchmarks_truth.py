"""The report over several trainings, on records made by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import benchmarks.truth_report as report
from benchmarks.truth import METRICS, put_together, read
from ibe_rl.storage.run_folder import write_json
from ibe_rl.types import Array


def estimate(value: float, low: float | None = None, high: float | None = None) -> dict[str, float]:
    return {"value": value, "low": value - 0.1 if low is None else low, "high": value + 0.1 if high is None else high}


def middle(values: Array) -> list[dict[str, float]]:
    return [estimate(float(np.median(each)), float(each.min()), float(each.max())) for each in values.T]


def age(policy: int, vocabulary: int, auc: float) -> dict[str, Any]:
    less = {metric: estimate(0.9 - auc, 0.9 - auc, 0.9 - auc) for metric in ("motion_auc", "came_true")}
    about = {"policy_frame": policy, "vocabulary_frame": vocabulary}
    return about | {"motion_auc": estimate(auc), "refreshed_minus_this": less}


def judged(folder: Path, agent: str, seed: int, auc: float) -> Path:
    """What task=evaluate and task=compare leave of a run, as far as the report reads it."""
    (folder / "evaluation").mkdir(parents=True)
    write_json(folder / "summary.json", {"agent": agent, "seed": seed, "success_rate": 0.9})
    plain = dict.fromkeys(METRICS, estimate(0.5))
    rows: list[dict[str, Any]] = [
        {"explainer": name, "horizon_steps": horizon} | plain | {"motion_auc": estimate(value)}
        for horizon in (20, 60)
        for name, value in (("ibe:axis", auc), ("baseline:present_velocity", 0.9), ("baseline:paper", 0.8))
    ]
    for row in rows:
        row["observer_error"] = estimate(2.0)
        row["left_right"] = {"value": [4, 4], "low": None, "high": None}
    shuffled = {"explainer": "baseline:shuffled", "horizon_steps": 60} | plain | {"refits": {"motion_auc": [0.4, 0.6]}}
    paired = [
        {"metric": "motion_auc", "horizon_steps": 60, "minus": minus, "difference": estimate(auc - other, auc - other)}
        for minus, other in (("baseline:present_velocity", 0.9), ("baseline:state_regressor", 0.99))
    ]
    quality = {"protocol": {"mapping": "axis"}, "rows": [*rows, shuffled], "paired": paired}
    quality |= {
        "confidence": {"risk_at_80_minus_risk_all": estimate(-0.3)},
        "changing_policy": [age(10, 10, 0.5), age(20, 10, 0.7), age(20, 20, 0.9)],
    }
    observers = [
        {"explainer": name, "observer_error": estimate(error)}
        | {"minus_no_explanation": estimate(error - 5), "minus_paper": estimate(error - 4)}
        for name, error in (("no_explanation", 5.0), ("ibe:axis", 2.0))
    ]
    write_json(folder / "evaluation" / "quality.json", quality)
    write_json(folder / "evaluation" / "compare.json", {"rows": [dict(rows[3], explainer="ibe:axis")]})
    write_json(folder / "evaluation" / "observers.json", {"rows": observers})
    return folder


@pytest.fixture
def together(tmp_path: Path) -> dict[str, Any]:
    runs = [("ppo", 0, 0.97), ("ppo", 1, 0.99), ("ppo", 2, 0.995), ("dqn", 0, 0.85)]
    folders = [judged(tmp_path / f"{agent}{seed}", agent, seed, auc) for agent, seed, auc in runs]
    return put_together([read(folder) for folder in folders], middle)


def test_runs_are_put_together_by_their_kind_of_agent(together: dict[str, Any]) -> None:
    assert list(together["iqm"]) == ["ppo", "dqn"]
    assert together["iqm"]["ppo"]["ibe:axis"]["motion_auc"] == estimate(0.99, 0.97, 0.995)
    assert together["iqm"]["ppo"]["refit:axis"]["motion_auc"]["value"] == 0.99
    assert together["iqm"]["dqn"]["baseline:present_velocity"]["motion_auc"]["value"] == 0.9
    assert [run["horizons"][20]["value"] for run in together["runs"]] == [0.97, 0.99, 0.995, 0.85]


def test_what_one_run_lacks_is_not_reported_of_all(together: dict[str, Any]) -> None:
    runs = together["runs"]
    runs[1]["values"]["ibe:axis"]["ece"] = None
    assert put_together(runs, middle)["iqm"]["ppo"]["ibe:axis"]["ece"] is None


def test_the_page_says_what_was_reached(
    together: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "QUALITY.md"
    page.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    monkeypatch.setattr(report, "PAGE", page)
    report.insert_tables(together)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    ppo, dqn = text.split("### DQN")
    assert "| `motion_auc` ≥ 0.98 | .990 [.970, .995] | .970 .990 .995 | reached |" in ppo
    assert "| `motion_auc` ≥ 0.98 | .850 [.850, .850] | .850 | **no** |" in dqn
    assert "3 of 3 seeds" in ppo
    assert "| 60% less | 2.00/5.00" in ppo
    assert "4/4 4/4 4/4 | reached |" in ppo
    assert "| present velocity | .900 [.900, .900] |" in ppo
    assert "seed 0: 0.41 **0.50** 0.59" in ppo
    assert "| 0 | .900 | .700 | +0.200 [+0.200, +0.200] | +0.200 [+0.200, +0.200] |" in ppo
    once = page.read_text()
    report.insert_tables(together)
    assert page.read_text() == once


@pytest.mark.slow
def test_the_pictures_are_drawn(together: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "PICTURES", tmp_path)
    report.draw(together)
    for name in ("truth", "tradeoff", "controls"):
        assert (tmp_path / f"quality_{name}.png").read_bytes().startswith(b"\x89PNG")
