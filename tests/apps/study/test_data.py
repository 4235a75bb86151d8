"""Answers become rows that are scored rightly and hold nothing that tells who somebody is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from answered_study import person, said
from own_study import write_study

from ibe_rl.apps.study.columns import ITEMS, PEOPLE, TRIALS, counted, loss_of
from ibe_rl.apps.study.data import free_texts, tables_of
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.sitting import schedule_of


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return open_study(write_study(tmp_path_factory.mktemp("data") / "study", episodes=4, quota=6))


def episode_of(study: Study, one, page: str) -> int:
    return next(each.episode for each in schedule_of(study, one) if each.name == page)


def test_a_trial_is_a_row(study: Study) -> None:
    one = person(1, "ibe")
    truth = study.stimuli[episode_of(study, one, "trial/1/2")]["truth"]["at"]
    answers = [
        said("trial/practice/1", at=0.5, confidence=10),
        said("trial/1/1", at=0.5, confidence=20, took_ms=1000),
        said("attention/1", choice=1),
        said("trial/1/2", at=truth + 0.25, confidence=90, took_ms=3000),
    ]
    data = tables_of(study, [(one, answers)])
    assert list(data.trials.columns) == list(TRIALS)
    assert data.trials["block"].tolist() == ["practice", "ibe", "ibe"]
    last = data.trials.iloc[2]
    assert (last["person"], last["trial"], last["order"], last["confidence"]) == (1, 2, 3, 90)
    assert last["error"] == pytest.approx(0.25)
    assert last["loss"] == pytest.approx(25)
    assert np.isnan(last["correct"])
    assert (last["took_ms"], last["hidden_ms"], last["attention_ok"]) == (3000, 10, 1)
    assert counted(data.trials)["trial"].tolist() == [1, 2]
    [row] = data.people.to_dict("records")
    assert row == {
        "person": 1,
        "pilot": 0,
        "arms": "ibe",
        "ended": "finished",
        "counted_trials": 2,
        "failed_checks": 0,
        "median_s": 2.0,
        "hidden_s": pytest.approx(0.04),
    }
    assert [*row, "excluded"] == list(PEOPLE)


def test_somebody_who_left_at_once_is_a_person_without_trials(study: Study) -> None:
    data = tables_of(study, [(person(1, "none", ended=None), [])])
    assert len(data.trials) == len(data.items) == 0
    assert data.people["ended"].tolist() == ["under_way"]
    assert data.people["median_s"].isna().all()


def test_choices_are_right_or_wrong() -> None:
    assert loss_of({"choice": 2}, {"at": 0.5, "choice": 2}) == 0
    assert loss_of({"choice": 1}, {"at": 0.5, "choice": 2}) == 100
    assert loss_of({"at": 0.75}, {"at": 0.5, "choice": 2}) == pytest.approx(25)


def test_choices_have_no_error(tmp_path: Path) -> None:
    trials = {"task": "next_words", "practice": 0, "each_arm": 2, "attention_checks": 0}
    study = open_study(write_study(tmp_path / "study", trials=trials))
    one = person(1, "none")
    truth = study.stimuli[episode_of(study, one, "trial/1/1")]["truth"]["choice"]
    [row] = tables_of(study, [(one, [said("trial/1/1", choice=truth, confidence=5)])]).trials.to_dict("records")
    assert (row["answer"], row["truth"], row["correct"], row["loss"]) == (truth, truth, 1, 0)
    assert np.isnan(row["error"])


def test_a_failed_check_is_counted(study: Study) -> None:
    one = person(1, "none")
    data = tables_of(study, [(one, [said("attention/1", choice=0), said("trial/1/1", at=0.5, confidence=1)])])
    assert data.people["failed_checks"].tolist() == [1]
    assert data.trials["attention_ok"].tolist() == [0]


def test_items_are_scored_and_texts_are_kept_apart(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    (folder / "texts/en/scales/satisfaction.yaml").write_text(
        "options: [no, a little, yes]\nquestions: [I liked it., {text: I was bored., reversed: true, optional: true}]"
    )
    study = open_study(folder)
    answers = [
        said("demographics", choices=["I am 30", 1]),
        said("scale/satisfaction", choices=[2, 2]),
        said("comment", text="my name is Jo"),
    ]
    given = [(person(1, "ibe"), answers), (person(2, "ibe"), [said("scale/satisfaction", choices=[0, None])])]
    items = tables_of(study, given).items
    assert list(items.columns) == list(ITEMS)
    assert items["scale"].tolist() == ["demographics", *["satisfaction"] * 4]
    assert items["item"].tolist() == [2, 1, 2, 1, 2]
    assert items["score"].tolist()[:4] == [1, 2, 0, 0]
    assert np.isnan(items["score"].tolist()[4])
    assert free_texts(study, given) == [
        (1, "demographics", "How old are you?", "I am 30"),
        (1, "comment", "", "my name is Jo"),
    ]


def test_nothing_tells_who_somebody_is(study: Study) -> None:
    data = tables_of(study, [(person(1, "ibe"), [said("comment", text="my name is Jo")])])
    for table in (data.trials, data.items, data.people):
        text = table.to_csv()
        assert "secret" not in text
        assert "Jo" not in text
        assert "hash" not in text
