"""Simulated people go through a study: counted as they ended, marked as pilots, and nothing of theirs is lost."""

from __future__ import annotations

import sys
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_study import stimulus, write_study
from rich.console import Console

from benchmarks.study_load import through_kills
from ibe_rl.apps.study import by_messages
from ibe_rl.apps.study.analysis import sittings
from ibe_rl.apps.study.answers import FILE, Answer, Answers
from ibe_rl.apps.study.data import tables_of
from ibe_rl.apps.study.folder import open_study
from ibe_rl.apps.study.pilot import Piloted, pilot, pilot_report, slowest_ms
from ibe_rl.apps.study.simulated import Participant
from ibe_rl.apps.study.sitting import enter, schedule_of
from ibe_rl.apps.study.visits import Visit, lost_and_changed
from ibe_rl.types import ConfigError


def silent(_: object) -> None:
    """Prints nothing."""


def piloted(folder: Path, people: int = 4, **settings: Any) -> Piloted:
    return pilot(folder, people, **{"through": "protocol", "drop_out": 0.0, "say": silent, **settings})


def said(found: Piloted) -> str:
    """The report as it is printed."""
    console = Console(width=100, file=(printed := StringIO()))
    for part in pilot_report(found):
        console.print(part)
    return printed.getvalue()


def test_all_finish_and_none_of_them_counts(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    found = piloted(folder, people=6, lapse=0.0)
    assert [visit.ended for visit in found.visits] == ["finished"] * 6
    assert sorted(found.arms) == [("ibe",)] * 3 + [("none",)] * 3
    assert (found.lost, found.changed) == (0, 0)
    answers = Answers(folder / FILE)
    assert answers.people() == []
    assert not answers.begun()
    assert [person.pilot for person in answers.people(pilots=True)] == [True] * 6
    pages = len(schedule_of(open_study(folder), answers.people(pilots=True)[0]))
    assert [len(visit.confirmed) for visit in found.visits] == [pages] * 6
    assert len(found.confirmation_s) == 6 * pages
    answers.close()


def test_the_same_seed_gives_the_same_answers(tmp_path: Path) -> None:
    once, again, other = (
        [
            [answer.value for answer in visit.confirmed]
            for visit in piloted(write_study(tmp_path / name), people=1, seed=seed).visits
        ]
        for name, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert once == again
    assert once != other


def test_people_leave_and_fail_as_often_as_they_are_told_to(tmp_path: Path) -> None:
    left = piloted(write_study(tmp_path / "left"), people=4, drop_out=1.0)
    assert [(visit.ended, visit.confirmed) for visit in left.visits] == [("left", [])] * 4
    careless = write_study(tmp_path / "careless", comprehension_attempts=1)
    ended = [visit.ended for visit in piloted(careless, people=12, lapse=1.0).visits]
    assert set(ended) == {"finished", "screened_out"}  # they guess, of two options


def test_what_they_needed_is_their_pace_and_what_was_played(tmp_path: Path) -> None:
    folder = write_study(tmp_path / "study")
    [visit] = piloted(folder, people=1, pace_s=10.0).visits
    answered_s = sum(answer.took_ms for answer in visit.confirmed) / 1000
    assert visit.needed_s == pytest.approx(answered_s + 3 * 0.02, abs=0.02)  # three episodes of two frames of 10 ms
    assert visit.needed_s == pytest.approx(visit.person.pace_s * len(visit.confirmed), rel=0.35)


def test_the_analysis_sees_the_stated_skill(tmp_path: Path) -> None:
    """Who believes all errs as the observers do with the arm's words, and by the stated noise around that."""
    trials = {"practice": 0, "each_arm": 8, "attention_checks": 0}
    folder = write_study(tmp_path / "study", episodes=8, trials=trials, arms=["none", "ibe"])
    piloted(folder, people=12, at_once=6, reliance=(1.0, 1.0), noise=0.05, lapse=0.0)
    study = open_study(folder)
    given, pilots = sittings(study)
    table = tables_of(study, given).trials
    told = [stimulus(episode)["observers"][arm]["at"] for episode, arm in zip(table.episode, table.arm, strict=True)]
    inside = np.abs(np.array(told) - 0.5) < 0.35  # where noise seldom meets the edge of the picture
    off = table.answer.to_numpy() - told
    assert (pilots, len(table)) == (True, 12 * 8)
    assert off[inside].mean() == pytest.approx(0.0, abs=0.03)
    assert off[inside].std() == pytest.approx(0.055, rel=0.35)  # people differ: some have more, some less
    error = {arm: table.error[table.arm == arm].mean() for arm in ("ibe", "none")}
    alone = np.mean([abs(stimulus(episode)["observers"]["none"]["at"] - episode / 10) for episode in range(8)])
    assert error["none"] == pytest.approx(alone, abs=0.03)
    assert error["ibe"] == pytest.approx(0.055 * np.sqrt(2 / np.pi), abs=0.015)


def test_the_report_counts_by_arm() -> None:
    visits = [
        Visit(Participant(), np.random.default_rng(0), ended=ended, needed_s=minutes * 60)
        for ended, minutes in (("finished", 4), ("finished", 8), ("left", 1), ("screened_out", 1), ("refused", 1))
    ]
    arms = [("none", "ibe")] * 3 + [("ibe", "none")] * 2
    text = said(Piloted(visits, arms, 1, 2, [0.1] * 99 + [0.5], 3.0))
    rows = [line.split("│")[1:-1] for line in text.splitlines() if line.startswith("│")]
    assert [[cell.strip() for cell in row] for row in rows] == [
        ["ibe then none", "2", "0", "1", "0", "-"],
        ["none then ibe", "3", "2", "0", "1", "6.0"],
        ["all", "5", "2", "1", "1", "6.0"],
    ]
    assert "1 lost, 2 changed or doubled, 1 refused" in text
    assert slowest_ms([0.1] * 99 + [0.5]) == pytest.approx(104)


def test_a_lost_and_a_changed_answer_are_noticed(tmp_path: Path) -> None:
    study, answers = open_study(write_study(tmp_path / "study")), Answers(tmp_path / FILE)
    person = enter(study, answers, pilot=True)
    kept, changed = Answer("consent", 1, {"agrees": True}, 1, 0), Answer("instructions", 1, {}, 1, 0)
    for answer in (kept, changed):
        answers.keep(person, answer)
    told = [kept, Answer("instructions", 1, {"more": 1}, 1, 0), Answer("debriefing", 1, {}, 1, 0)]
    visit = Visit(Participant(), np.random.default_rng(0), token=person.token, confirmed=told)
    assert lost_and_changed(answers, [visit]) == (1, 1)
    answers.close()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"through": "post"}, "through=post: allowed is page or protocol"),
        ({"at_once": 0}, "at_once=0: allowed is 1 or more"),
        ({"people": 0}, "people=0: allowed is 1 or more"),
        ({"address": "http://127.0.0.1:1"}, "address=http://127.0.0.1:1: no study answers there"),
        ({"through": "page", "chromium": "/no/browser"}, "chromium=/no/browser: no program is there"),
        ({"through": "page", "chromium": sys.executable}, "chromium=.*: does not start .*; allowed is the path"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, Any], says: str
) -> None:
    monkeypatch.setattr(by_messages, "SERVER_AWAY_S", 0.0)
    with pytest.raises(ConfigError, match=says):
        piloted(write_study(tmp_path / "study"), **wrong)


@pytest.mark.slow
def test_nothing_is_lost_while_the_server_is_killed(tmp_path: Path) -> None:
    """benchmarks/study_load.py does it with 60 people and 10 kills."""
    folder = write_study(tmp_path / "study")
    found, kills = through_kills(folder, people=10, at_once=5, kills=2)
    assert kills == 2
    assert (found.lost, found.changed) == (0, 0)
    assert {visit.ended for visit in found.visits} <= {"finished", "left", "screened_out"}
    answers = Answers(folder / FILE)
    there = sum(len(answers.answers_of(person)) for person in answers.people(pilots=True))
    assert there == sum(len(visit.confirmed) for visit in found.visits)
    answers.close()
