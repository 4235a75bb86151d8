"""The report over several trainings, on records made by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import truth
from benchmarks.truth import METRICS, RESULTS, put_together, read
from benchmarks.truth_figures import draw
from benchmarks.truth_report import PAGE, insert_tables
from ibe_rl.storage.run_folder import read_json, write_json
from ibe_rl.types import Array


def estimate(value: float, low: float | None = None, high: float | None = None) -> dict[str, float]:
    return {"value": value, "low": value - 0.1 if low is None else low, "high": value + 0.1 if high is None else high}


NOT_KNOWN = dict.fromkeys(("value", "low", "high"))


def middle(values: Array) -> list[dict[str, float]]:
    return [estimate(float(np.median(each)), float(each.min()), float(each.max())) for each in values.T]


def age(policy: int, vocabulary: int, auc: float) -> dict[str, Any]:
    less = {metric: estimate(0.9 - auc, 0.9 - auc, 0.9 - auc) for metric in ("motion_auc", "came_true")}
    about = {"policy_frame": policy, "vocabulary_frame": vocabulary}
    return about | {"motion_auc": estimate(auc), "refreshed_minus_this": less}


def aloud(came_true: float, lag_steps: float | None) -> list[dict[str, Any]]:
    """Of quality.json: what is spoken, what each moment alone says, and what came true."""
    often = {"phrase_changes_per_100": estimate(1.5), "flicker": estimate(0.05)}
    row = {"explainer": "spoken", "came_true": estimate(came_true), "lag_steps": lag_steps, "ece": estimate(0.03)}
    rare = {"came_true": estimate(0.9), "lag_steps": 2.0}
    return [row | often, {"explainer": "moment"} | rare | often, {"explainer": "real"} | rare | often]


def judged(
    folder: Path, agent: str, seed: int, auc: float, spoken: list[dict[str, Any]] | None = None, words: float = 0.5
) -> Path:
    """What task=evaluate and task=compare leave of a run, as far as the report reads it."""
    (folder / "evaluation").mkdir(parents=True)
    write_json(folder / "summary.json", {"agent": agent, "seed": seed, "success_rate": 0.9})
    plain = dict.fromkeys(METRICS, estimate(0.5))
    rows: list[dict[str, Any]] = [
        {"explainer": name, "horizon_steps": horizon}
        | plain
        | {"motion_auc": estimate(value)}
        | {"motion_auc_words": estimate(words)}
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
    if spoken:
        quality["spoken"] = {"rows": spoken}
        observers.append({"explainer": "words_alone", "observer_error": estimate(3.0)})
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


def test_a_mean_of_most_runs_says_how_many_they_are(tmp_path: Path) -> None:
    runs = [read(judged(tmp_path / f"ppo{seed}", "ppo", seed, 0.99)) for seed in range(4)]
    for run, ece in zip(runs, (0.01, None, 0.02, 0.03), strict=True):
        run["values"]["ibe:axis"]["ece"] = ece
    together = put_together(runs, middle)
    assert together["iqm"]["ppo"]["ibe:axis"]["ece"] == estimate(0.02, 0.01, 0.03) | {"runs": 3}
    insert_tables(together, tmp_path / "QUALITY.md")
    assert "| .020 [.010, .030] (3 runs) |" in (tmp_path / "QUALITY.md").read_text()


def test_the_page_says_what_was_reached(together: dict[str, Any], tmp_path: Path) -> None:
    page = tmp_path / "QUALITY.md"
    page.write_text("before\n<!-- tables: python -m benchmarks.truth -->\nold\n<!-- end of tables -->\nafter\n")
    insert_tables(together, page)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    ppo, dqn = text.split("### DQN")
    assert "by 0.001 on every seed | 1 of 3 seeds | -0.020 [-0.020, +0.080] +0.000 " in ppo
    assert "| `motion_auc_disobeyed` ≥ 0.99 | .500 [.500, .500] | .500 .500 .500 | **no** |" in ppo
    assert "3 of 3 seeds" in ppo
    assert "| observer's error at least 60 % less than without | 60% less | 2.00/5.00 2.00/5.00 2.00/5.00 |" in ppo
    assert "| observer's error at least 40 % less than without | 60% less | 2.00/5.00 | reached |" in dqn
    assert "4/4 4/4 4/4 | reached |" in ppo
    assert "| present velocity | .900 [.900, .900] |" in ppo
    assert "seed 0: 0.41 **0.50** 0.59" in ppo
    assert "| 0 | .900 | .700 | +0.200 [+0.200, +0.200] | +0.200 [+0.200, +0.200] |" in ppo
    once = page.read_text()
    insert_tables(together, page)
    assert page.read_text() == once


def test_a_difference_of_a_thousandth_is_asked_of_every_seed(together: dict[str, Any], tmp_path: Path) -> None:
    for run, value in zip(together["runs"], (0.001, 0.002, 0.0021), strict=False):
        run["over_regressor"] = estimate(value, -1, 1)  # the value counts, not its interval
    insert_tables(together, tmp_path / "QUALITY.md")
    ppo, dqn = (tmp_path / "QUALITY.md").read_text().split("### DQN")
    assert "| 3 of 3 seeds | +0.001 [-1.000, +1.000] +0.002 [-1.000, +1.000] +0.002 [-1.000, +1.000] | reached |" in ppo
    assert "| 0 of 1 seeds | -0.140 [-0.140, -0.040] | **no** |" in dqn


def test_what_a_first_vocabulary_does_not_know_is_left_open(together: dict[str, Any], tmp_path: Path) -> None:
    less = together["runs"][1]["changing_policy"][0]["refreshed_minus_this"]
    less["came_true"] = NOT_KNOWN
    insert_tables(together, tmp_path / "QUALITY.md")
    assert "| 1 | .900 | .700 | +0.200 [+0.200, +0.200] | - |" in (tmp_path / "QUALITY.md").read_text()


def test_the_confidence_of_a_run_that_cannot_tell_what_its_words_mean_is_left_open(
    together: dict[str, Any], tmp_path: Path
) -> None:
    for run, risk in zip(
        together["runs"], (estimate(-0.3, -0.4, -0.2), NOT_KNOWN, estimate(-0.3, -0.4, 0.2)), strict=False
    ):
        run["risk"] = risk
    insert_tables(together, tmp_path / "QUALITY.md")
    text = (tmp_path / "QUALITY.md").read_text()
    assert (
        "go as predicted more often | 1 of 3 seeds | -0.300 [-0.400, -0.200] - -0.300 [-0.400, +0.200] | **no** |"
        in text
    )


def page_of(folder: Path, *spoken: list[dict[str, Any]] | None) -> str:
    """The tables of PPO runs that speak so."""
    runs = [read(judged(folder / f"ppo{seed}", "ppo", seed, 0.99, one, 0.98)) for seed, one in enumerate(spoken)]
    insert_tables(put_together(runs, middle), folder / "QUALITY.md")
    return (folder / "QUALITY.md").read_text()


def test_what_is_spoken_has_its_goals_and_its_table(tmp_path: Path) -> None:
    text = page_of(tmp_path, aloud(0.92, 1), aloud(0.95, 2), aloud(0.94, 30))
    assert "| `came_true` as spoken ≥ 0.93 | .940 [.920, .950] | .920 .950 .940 | reached |" in text
    assert "| phrase changes in 100 steps as spoken ≤ 2.5 | 1.50 [1.50, 1.50] | 1.50 1.50 1.50 | reached |" in text
    assert "| `flicker` as spoken ≤ 0.1 | .050 [.050, .050] | .050 .050 .050 | reached |" in text
    assert "| `ece` of what is spoken ≤ 0.02 | .030 [.030, .030] | .030 .030 .030 | **no** |" in text
    assert "| steps late as spoken ≤ 5, median of the seeds | median 2 | 1 2 30 | reached |" in text
    assert "| as it speaks | .940 [.920, .950] | 1.50 [1.50, 1.50] | .050 [.050, .050] | 2.00 [1.00, 30.00] |" in text
    assert (
        "| each moment alone | .900 [.900, .900] | 1.50 [1.50, 1.50] | .050 [.050, .050] | 2.00 [2.00, 2.00] | - |"
        in text
    )
    assert "| the words of axis alone | - | - | - | - | - | - | - | 3.00 [3.00, 3.00] |" in text
    assert "| axis (default, as refreshed) | .990 [.990, .990] | .980 [.980, .980] |" in text


def test_a_late_one_and_a_run_without_a_lasting_change(tmp_path: Path) -> None:
    late = page_of(tmp_path / "late", aloud(0.9, 5.5))
    assert "| steps late as spoken ≤ 5, median of the seeds | median 5.5 | 5.5 | **no** |" in late
    assert "| - | 1 - | - |" in page_of(tmp_path / "still", aloud(0.9, 1), aloud(0.9, None))


@pytest.mark.parametrize("spoken", [(None, aloud(0.9, 1)), (aloud(0.9, 1), None), (None, None)])
def test_nothing_is_said_of_what_some_run_lacks(
    spoken: tuple[list[dict[str, Any]] | None, list[dict[str, Any]] | None], tmp_path: Path
) -> None:
    each = " ".join(".900" if one else "-" for one in spoken)
    assert f"| `came_true` as spoken ≥ 0.93 | - | {each} | - |" in page_of(tmp_path, *spoken)


@pytest.mark.slow
def test_the_page_has_the_tables_of_the_numbers_beside_it(tmp_path: Path) -> None:
    """Read back, their horizons are text."""
    truth.write(read_json(RESULTS), tmp_path)
    assert (tmp_path / "QUALITY.md").read_text().strip() in PAGE.read_text()
    assert read_json(tmp_path / RESULTS.name) == read_json(RESULTS)
    for name in ("truth", "tradeoff", "controls"):
        assert (tmp_path / f"quality_{name}.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_is_judged_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    done, new = judged(tmp_path / "done", "ppo", 0, 0.9), judged(tmp_path / "new", "ppo", 1, 0.9)
    observers = new / "evaluation" / "observers.json"
    observers.rename(tmp_path / "kept")  # it was killed before it wrote this one

    def run(command: list[str], **_: Any) -> None:
        asked.append(command[2:])
        (tmp_path / "kept").rename(observers)

    monkeypatch.setattr(truth.subprocess, "run", run)
    monkeypatch.setattr(truth, "write", lambda *_: None)
    for _ in range(2):
        truth.main([str(done), str(new)])
    assert asked == [[f"run={new}", "task=evaluate", "viewer=off", *truth.FULL]]


def test_runs_that_were_judged_otherwise_are_not_put_together(tmp_path: Path) -> None:
    runs = [judged(tmp_path / name, "ppo", seed, 0.9, aloud(0.9, 1.0)) for seed, name in enumerate(("old", "new"))]
    truth.refuse_mixed(runs)
    new = runs[1] / "evaluation" / "quality.json"
    quality = read_json(new)
    for part, name, value in (("protocol", "stride", 4), ("spoken", "episodes", 20)):
        write_json(new, quality | {part: quality[part] | {name: value}})
        with pytest.raises(SystemExit, match=rf"new: judged with .*{name}': {value}\b.* allowed are runs judged alike"):
            truth.main([str(runs[0]), str(runs[1])])


def test_what_cannot_be_judged_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        truth.main([str(tmp_path)])
    assert (
        f"RUN={tmp_path}: allowed is the folder of a finished run (it has no summary.json)" in capsys.readouterr().err
    )
    with pytest.raises(SystemExit):
        truth.main([str(tmp_path), "--quick"])
    assert "--quick: allowed with --output=FOLDER, its figures mean nothing" in capsys.readouterr().err
    twice = judged(tmp_path / "run", "ppo", 0, 0.9)
    with pytest.raises(SystemExit):
        truth.main([str(twice), str(twice), "--report", "--output", str(tmp_path)])
    assert f"RUN={twice} {twice}: allowed is each run once" in capsys.readouterr().err


@pytest.mark.slow
def test_the_pictures_are_drawn(together: dict[str, Any], tmp_path: Path) -> None:
    together["iqm"]["ppo"]["refit:axis"]["came_true"] = None  # one of the runs does not know what its words mean
    draw(together, tmp_path)
    for name in ("truth", "tradeoff", "controls"):
        assert (tmp_path / f"quality_{name}.png").read_bytes().startswith(b"\x89PNG")
