"""The mixed model finds what was put into the answers."""

from __future__ import annotations

import numpy as np
import pytest
from answered_study import trials

from ibe_rl.apps.study.models import linear_model, r_script


def answers(people: int = 40, episodes: int = 12):
    random = np.random.default_rng(0)
    skill, hard = random.normal(0, 4, people), random.normal(0, 6, episodes)
    rows = [
        (person, episode, arm, 40 + skill[person] + hard[episode] - 8 * (arm == "ibe") + random.normal(0, 5))
        for person in range(people)
        for episode in range(episodes)
        for arm in [("none", "ibe")[(person + episode) % 2]]
    ]
    return trials(rows)


def test_people_and_episodes_are_told_from_the_arm() -> None:
    found = linear_model(answers(), ["none", "paper", "ibe"], "none")
    assert found is not None
    assert found["converged"]
    assert [*found["effects"]] == ["ibe"]
    effect = found["effects"]["ibe"]
    assert effect["low"] < -8 < effect["high"] < 0
    assert effect["p"] < 0.001
    assert found["residual"] == pytest.approx(5, rel=0.1)
    assert found["person"] == pytest.approx(4, rel=0.4)
    assert found["episode"] == pytest.approx(6, rel=0.5)


def test_too_little_for_a_model() -> None:
    table = answers(4, 3)
    assert linear_model(table[table["arm"] == "ibe"], ["none", "ibe"], "none") is None
    assert linear_model(table[table["arm"] == "none"], ["none", "ibe"], "none") is None
    assert linear_model(table[table["person"] < 2], ["none", "ibe"], "none") is None


def test_answers_that_are_all_alike_do_not_stop_the_analysis() -> None:
    table = answers(6, 3).assign(loss=0.0)
    found = linear_model(table, ["none", "ibe"], "none")
    assert found is None or found["effects"]["ibe"]["value"] == pytest.approx(0)


@pytest.mark.parametrize(("choices", "call"), [(False, "lmer(loss ~ arm"), (True, "glmer(correct ~ arm")])
def test_the_script_for_r_names_the_files(choices: bool, call: str) -> None:
    text = r_script(choices, "none", "study-A_table-trials_data.csv", "study-A_table-people_data.csv")
    assert call in text
    assert 'read.csv("data/study-A_table-trials_data.csv")' in text
    assert 'ref = "none"' in text
