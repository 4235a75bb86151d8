"""What explain.py judges and compares, small."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from processes import call

import explain
from benchmarks import foreseeing
from ibe_rl.config.settings import EvaluateConfig
from ibe_rl.evaluation.runs import load_run
from ibe_rl.predict.ensemble import EnsembleConfig

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
    assert (protocol["episodes"], protocol["horizon_steps"], protocol["stride"]) == (6, 20, 8)
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
