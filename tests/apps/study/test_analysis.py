"""One command makes tables, results and a page; pilots are called so wherever one looks."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from answered_study import fill
from own_study import write_study

from ibe_rl.apps.study.analysis import analyse, findings, sittings
from ibe_rl.apps.study.answers import FILE, Answers
from ibe_rl.apps.study.data import tables_of
from ibe_rl.apps.study.findings import beside_paper, caveats, least_effect, p_value
from ibe_rl.apps.study.folder import open_study
from ibe_rl.types import ConfigError

MORE = {
    "arms": ["none", "paper", "ibe"],
    "trials": {"practice": 1, "each_arm": 3, "attention_checks": 1, "transfer": 1},
}


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pilot of three arms, analysed."""
    folder = write_study(
        tmp_path_factory.mktemp("analysis") / "first_pilot", episodes=5, hypotheses=["Words help."], **MORE
    )
    fill(open_study(folder), 18, reliance=(1.0, 1.0))
    analyse(folder)
    return folder / "analysis"


def test_all_files_are_there(analysed: Path) -> None:
    assert {str(path.relative_to(analysed)) for path in analysed.rglob("*") if path.is_file()} == {
        "report.html",
        "results.json",
        "dataset_description.json",
        "free_texts.csv",
        "model.R",
        "data/study-FirstPilot_table-trials_data.csv",
        "data/study-FirstPilot_table-items_data.csv",
        "data/study-FirstPilot_table-people_data.csv",
        *(f"{name}.png" for name in ("means", "episodes", "confidence", "learning", "scales")),
    }


def test_who_believes_true_words_errs_less(analysed: Path) -> None:
    found = json.loads((analysed / "results.json").read_text())
    test = found["registered"]
    assert (test["arms"], test["people"], test["paired"]) == (["ibe", "none"], [6, 6], False)
    assert test["p"] < 0.01
    assert test["difference"]["high"] < 0
    assert [one["arms"] for one in found["others"]] == [["paper", "none"]]
    assert found["people"] == {"begun": 18, "counted": 18, "by_arms": {"none": 6, "paper": 6, "ibe": 6}}
    assert found["observers"]["none"] > found["observers"]["ibe"] == 0
    assert found["transfer"]["people"] == [6, 6]
    assert found["model"]["effects"]["ibe"]["value"] < 0


def test_a_pilot_is_called_so(analysed: Path) -> None:
    page = (analysed / "report.html").read_text()
    assert "<title>Pilot: " in page
    assert "Pilot: no participants of the study." in page
    assert "18 people began, 18 count" in page
    assert json.loads((analysed / "results.json").read_text())["pilot"]
    assert json.loads((analysed / "dataset_description.json").read_text())["description"].startswith("Pilot")


def test_the_page_needs_nothing_else(analysed: Path) -> None:
    page = (analysed / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 5
    assert 'src="http' not in page
    assert "Words help." in page
    assert "lmer(loss ~ arm" in page
    assert "nine students" in page


def test_a_row_for_each_answer(analysed: Path) -> None:
    trials = pd.read_csv(analysed / "data/study-FirstPilot_table-trials_data.csv")
    assert len(trials) == 18 * (1 + 3 + 1)
    people = pd.read_csv(analysed / "data/study-FirstPilot_table-people_data.csv")
    assert people["excluded"].isna().all()
    assert len(pd.read_csv(analysed / "data/study-FirstPilot_table-items_data.csv")) == 18 * 3


def test_real_people_count_instead_of_pilots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_study(tmp_path / "study", scales=[], demographics=False)
    study = open_study(folder)
    fill(study, 4)
    fill(study, 4, pilot=False)
    given, pilot = sittings(study)
    assert not pilot
    assert [one.number for one, _ in given] == [5, 6, 7, 8]
    found = findings(study, tables_of(study, given), pilot)
    assert found["scales"] == []
    assert found["demographics"] == []
    assert any("fewer than 5 people" in line for line in caveats(found))
    assert "4 people; 2 and 2 in the registered test" in beside_paper(found)[0][2]
    analyse(folder)
    assert "Pilot" not in (folder / "analysis/report.html").read_text()
    assert "4 people began, 4 count" in capsys.readouterr().out


def test_choices_within_people(tmp_path: Path) -> None:
    trials = {"task": "next_words", "practice": 0, "each_arm": 2, "attention_checks": 0, "confidence": False}
    folder = write_study(tmp_path / "study", episodes=4, design="within", trials=trials)
    study = open_study(folder)
    fill(study, 8, reliance=(1.0, 1.0))
    analyse(folder)
    found = json.loads((folder / "analysis/results.json").read_text())
    assert (found["registered"]["paired"], found["choices"]) == (True, True)
    assert found["people"]["by_arms"] == {"none and ibe": 8}
    assert found["calibration"] == {}
    assert found["transfer"] is None
    assert not (folder / "analysis/confidence.png").exists()
    page = (folder / "analysis/report.html").read_text()
    assert "% wrong" in page
    assert "glmer(correct ~ arm" in page


def test_nobody_who_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """People have begun, and nobody has answered a trial."""
    folder = write_study(tmp_path / "study")
    study, answers = open_study(folder), Answers(folder / FILE)
    answers.begin(("ibe",), study.protocol, pilot=False)
    answers.close()
    analyse(folder)
    assert "The registered test cannot be done yet: 0 people with our vocabulary" in capsys.readouterr().out
    assert "There are too few answers to fit one." in (folder / "analysis/report.html").read_text()


def test_nobody_yet(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    with pytest.raises(ConfigError, match="nobody has taken part yet"):
        analyse(folder)
    assert not (folder / FILE).exists()
    Answers(folder / FILE).close()
    with pytest.raises(ConfigError, match="nobody has taken part yet"):
        analyse(folder)
    assert not (folder / "analysis").exists()


def test_a_study_that_was_changed(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    fill(open_study(folder), 2)
    (folder / "texts/en/consent.md").write_text("# Do you agree to this?")
    with pytest.raises(ConfigError, match="2 of 2 people answered another version"):
        analyse(folder)
    fill(open_study(folder), 2)  # pilots of the new version count by themselves
    assert len(sittings(open_study(folder))[0]) == 2
    fill(open_study(folder), 1, pilot=False)
    (folder / "texts/en/consent.md").write_text("# Do you?")
    with pytest.raises(ConfigError, match="1 of 1 people answered another version"):
        sittings(open_study(folder))


def test_numbers_in_sentences() -> None:
    assert [p_value(p) for p in (None, 0.0004, 0.04321)] == ["-", "< 0.001", "0.043"]
    assert least_effect((5, 4)) == pytest.approx(2.2, abs=0.05)  # what the paper could have shown
    assert least_effect((64, 64)) == pytest.approx(0.5, abs=0.01)
