"""Simulated people err as they are told to: by noise, lapses, and belief in the words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_study import write_study

from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.messages import check_answer
from ibe_rl.apps.study.schedule import pages_of
from ibe_rl.apps.study.simulated import Participant, answer_page, answer_trial, draw_people, time_s
from ibe_rl.apps.study.sitting import questions_of, understood
from ibe_rl.types import ConfigError

STIMULUS: dict[str, Any] = {
    "phrases": ["left", "straight", "right"],
    "truth": {"at": 0.5, "choice": 1},
    "observers": {"none": {"at": 0.2, "choice": 0}, "ibe": {"at": 0.6, "choice": 2}},
}


def answers(task: str, arm: str = "ibe", times: int = 4000, **person: float) -> np.ndarray:
    """The same trial answered often; by default without noise and lapses."""
    one = Participant(**{"noise": 0.0, "lapse": 0.0, **person})
    random = np.random.default_rng(1)
    field = "at" if task == "landing" else "choice"
    return np.array([answer_trial(one, STIMULUS, arm, task, random)[field] for _ in range(times)])


@pytest.mark.parametrize(
    ("arm", "reliance", "at"), [("ibe", 0.0, 0.2), ("ibe", 0.5, 0.4), ("ibe", 1.0, 0.6), ("none", 1.0, 0.2)]
)
def test_a_place_lies_between_what_is_seen_and_what_is_said(arm: str, reliance: float, at: float) -> None:
    assert answers("landing", arm, 3, reliance=reliance) == pytest.approx(at)


def test_noise_and_lapses_are_as_large_as_stated() -> None:
    assert answers("landing", reliance=0.5, noise=0.05).std() == pytest.approx(0.05, rel=0.05)
    lapses = answers("landing", reliance=0.5, lapse=0.3)
    assert np.mean(lapses != 0.4) == pytest.approx(0.3, abs=0.03)
    assert lapses[lapses != 0.4].mean() == pytest.approx(0.5, abs=0.03)


def test_a_place_is_in_the_picture() -> None:
    places = answers("landing", noise=1.0)
    assert places.min() == 0.0
    assert places.max() == 1.0


def test_a_choice_follows_the_words_as_often_as_they_are_believed() -> None:
    assert np.mean(answers("next_words", reliance=0.7) == 2) == pytest.approx(0.7, abs=0.03)
    assert np.mean(answers("next_words", reliance=1.0, noise=0.25) != 2) == pytest.approx(0.25, abs=0.03)
    assert set(answers("next_words", lapse=1.0)) == {0, 1, 2}
    assert set(answers("which_agent", "none", noise=0.5)) == {0, 1}


def test_who_guesses_is_less_sure() -> None:
    random = np.random.default_rng(0)
    sure, unsure = (
        np.mean(
            [
                answer_trial(Participant(lapse=lapse), STIMULUS, "ibe", "landing", random)["confidence"]
                for _ in range(400)
            ]
        )
        for lapse in (0.0, 1.0)
    )
    assert 70 < sure < 80
    assert 35 < unsure < 45


def test_people_differ_around_what_was_asked_for() -> None:
    people = draw_people(2000, seed=3, noise=0.1, reliance=(0.2, 0.8), drop_out=0.02, pace_s=10.0)
    assert people == draw_people(2000, seed=3, noise=0.1, reliance=(0.2, 0.8), drop_out=0.02, pace_s=10.0)
    assert people != draw_people(2000, seed=4, noise=0.1, reliance=(0.2, 0.8), drop_out=0.02, pace_s=10.0)
    assert np.median([one.noise for one in people]) == pytest.approx(0.1, rel=0.05)
    assert np.median([one.pace_s for one in people]) == pytest.approx(10.0, rel=0.05)
    trust = np.array([one.reliance for one in people])
    assert 0.2 <= trust.min() < 0.22
    assert 0.78 < trust.max() <= 0.8
    random = np.random.default_rng(0)
    assert np.median([time_s(people[0], random) for _ in range(2000)]) == pytest.approx(people[0].pace_s, rel=0.05)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"count": 0}, "people=0: allowed is 1 or more"),
        ({"noise": 1.5}, "noise=1.5: allowed is a number from 0 to 1"),
        ({"lapse": -0.1}, "lapse=-0.1: allowed"),
        ({"drop_out": float("nan")}, "drop_out=nan: allowed"),
        ({"reliance": (0.9, 0.1)}, "reliance=.*the lower one first"),
        ({"pace_s": 0.0}, "pace_s=0.0: allowed is a number above 0"),
    ],
)
def test_people_that_cannot_be_are_refused(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        draw_people(**{"count": 3, "seed": 0, **wrong})


@pytest.mark.parametrize("confidence", [True, False])
@pytest.mark.parametrize("task", ["landing", "next_words", "what_if", "which_agent"])
def test_every_page_gets_an_answer_that_fits(tmp_path: Path, task: str, confidence: bool) -> None:
    trials = {"practice": 1, "each_arm": 2, "task": task, "confidence": confidence}
    study = open_study(write_study(tmp_path / "study", trials=trials))
    random = np.random.default_rng(0)
    for lapse in (0.0, 1.0):
        for page in pages_of(study.settings, ("ibe",), 4, 1):
            value = answer_page(Participant(lapse=lapse), study, page, 1, random)
            check_answer(page, value, questions_of(study, page), task, confidence)


def test_who_lapses_fails_a_check_and_reads_before_the_second_attempt(tmp_path: Path) -> None:
    study, random = open_study(write_study(tmp_path / "study")), np.random.default_rng(0)
    page = next(one for one in pages_of(study.settings, ("ibe",), 4, 1) if one.kind == "comprehension")
    asked = questions_of(study, page)

    def passed(lapse: float, attempt: int) -> float:
        values = [answer_page(Participant(lapse=lapse), study, page, attempt, random) for _ in range(200)]
        return float(np.mean([understood(asked, value) for value in values]))

    assert passed(0.0, 1) == passed(1.0, 2) == 1.0
    assert passed(1.0, 1) == pytest.approx(0.5, abs=0.1)
