"""What is reported beside the test, on tables small enough to count."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from answered_study import trials
from own_study import write_study

from ibe_rl.apps.study import measures
from ibe_rl.apps.study.folder import Study, open_study

ARMS = ["none", "ibe"]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return open_study(write_study(tmp_path_factory.mktemp("measures") / "study"))


def test_alpha_of_a_known_table() -> None:
    """Item variances 1, 1 and 1, variance of the sum 7: alpha = 3/2 (1 - 3/7)."""
    scores = np.array([[1.0, 1.0, 2.0], [2.0, 3.0, 1.0], [3.0, 2.0, 3.0]])
    total = scores.sum(axis=1).var(ddof=1)
    assert total == pytest.approx(4.0)
    assert measures.cronbach_alpha(scores) == pytest.approx(1.5 * (1 - 3 / 4))
    assert measures.cronbach_alpha(np.repeat([[1.0], [2.0], [5.0]], 4, axis=1)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "scores", [[[1.0, 2.0]], [[1.0], [2.0]], [[1.0, 2.0], [2.0, 1.0]], [[1.0, 2.0], [np.nan, 1.0]]]
)
def test_alpha_that_is_undefined(scores: list[list[float]]) -> None:
    assert measures.cronbach_alpha(np.array(scores)) is None


def test_confidence_against_being_right() -> None:
    """Half of the answers with 90 % are right, none with 10 %: the error is the mean of .4 and .1, the slope .5/.8."""
    rows = [(0, 0, "ibe", 5.0), (1, 0, "ibe", 50.0), (0, 1, "ibe", 50.0), (1, 1, "ibe", 50.0)]
    found = measures.calibration(trials(rows, confidence=[90, 90, 10, 10]), 100)
    assert found is not None
    assert found["ece"]["value"] == pytest.approx(0.25)
    assert found["slope"]["value"] == pytest.approx(0.625)
    assert found["right"]["value"] == pytest.approx(0.25)
    assert found["confidence"]["value"] == pytest.approx(0.5)
    assert [(one["answers"], one["value"]) for one in found["bins"]] == [(2, 0.0), (2, 0.5)]


def test_confidence_that_was_not_asked_for() -> None:
    assert measures.calibration(trials([(0, 0, "ibe", 5.0)], confidence=[np.nan]), 100) is None


def test_confidence_that_never_changes_has_no_slope() -> None:
    rows = [(person, 0, "ibe", 5.0) for person in range(3)]
    found = measures.calibration(trials(rows, confidence=50), 50)
    assert found is not None
    assert found["slope"]["value"] is None


def test_learning_is_the_slope_over_trials() -> None:
    rows = [(person, trial, "ibe", 20.0 - 3 * trial + person) for person in range(2) for trial in range(1, 5)]
    found = measures.learning(trials(rows, trial=[1, 2, 3, 4] * 2), ARMS, 100)
    assert [*found] == ["ibe"]
    assert found["ibe"]["trial"] == [1, 2, 3, 4]
    assert found["ibe"]["loss"] == pytest.approx([17.5, 14.5, 11.5, 8.5])
    assert found["ibe"]["slope"]["value"] == pytest.approx(-3)


def test_transfer_between_people() -> None:
    rows = [(person, 9, ARMS[person % 2], 10.0 * (person % 2) + person) for person in range(6)]
    table = trials(rows).assign(block="transfer", arm="none")
    found = measures.transfer(table, ("ibe", "none"), 500)
    assert found is not None
    assert found["people"] == [3, 3]
    assert found["p"] == pytest.approx(0.1)
    assert measures.transfer(trials(rows), ("ibe", "none"), 500) is None


def test_transfer_within_people() -> None:
    rows = [
        (person, episode, block, 10.0 * episode)
        for person in range(4)
        for episode, block in enumerate(("none", "transfer"))
    ]
    table = trials(rows).assign(arms="none>ibe", arm="none")
    table.loc[table["person"] > 1, "block"] = ["transfer", "none"] * 2
    found = measures.transfer(table, ("ibe", "none"), 500)
    assert found is not None
    assert (found["arms"], found["paired"], found["people"]) == (["transfer", "none"], True, [4, 4])


def test_scales_by_arm_with_turned_items() -> None:
    columns = ["person", "arms", "scale", "item", "score", "options"]
    rows = [(1, "ibe", "s", 1, 4, 5), (1, "ibe", "s", 2, 2, 5), (2, "none", "s", 1, 0, 5), (2, "none", "s", 2, 2, 5)]
    [found] = measures.scales(pd.DataFrame([*rows, (1, "ibe", "demographics", 1, 0, 2)], columns=columns), ARMS, 50)
    assert (found["scale"], found["items"], found["people"]) == ("s", 2, 2)
    assert {arm: one["value"] for arm, one in found["groups"].items()} == {"none": 25.0, "ibe": 75.0}
    several = pd.DataFrame([(one[0], "none>ibe", *one[2:]) for one in rows], columns=columns)
    assert [*measures.scales(several, ARMS, 50)[0]["groups"]] == ["all"]


def test_demographics_are_counted(study: Study) -> None:
    items = pd.DataFrame([("demographics", 2, 0.0), ("demographics", 2, np.nan)], columns=["scale", "item", "chosen"])
    assert measures.demographics(study, items) == [
        {"question": "Do you fly?", "counts": {"y": 1, "n": 0, "no answer": 1}}
    ]


def test_each_episode_beside_the_observers(study: Study) -> None:
    rows = [(person, 2, ARMS[person % 2], 10.0 + person) for person in range(6)]
    [found] = measures.episodes(study, trials(rows, error=0.1), ARMS, ("ibe", "none"))
    assert (found["episode"], found["file"], found["people"]) == (2, "002", {"none": 3, "ibe": 3})
    assert found["loss"] == {"none": 12.0, "ibe": 13.0}
    assert found["observers"] == {"none": pytest.approx(70.0), "ibe": pytest.approx(0.0)}
    assert found["p"] == pytest.approx(0.7)  # ranks 2, 4, 6 against 1, 3, 5
    assert measures.observer_means([found], ARMS) == {"none": pytest.approx(70.0), "ibe": pytest.approx(0.0)}
    assert measures.observer_losses({"truth": {"at": 0.5}}, ARMS, "at") == {"none": None, "ibe": None}
    assert measures.observer_means([], ARMS) == {"none": None, "ibe": None}


def test_an_arm_without_people_has_no_mean() -> None:
    found = measures.arm_means(trials([(0, 0, "ibe", 4.0), (0, 1, "ibe", 8.0)]), ARMS, 50)
    assert found["none"] == {"people": 0, "each": [], "loss": None}
    assert found["ibe"]["each"] == [6.0]
