"""Where people come from and where they go back to."""

from __future__ import annotations

from pathlib import Path

import pytest

from ibe_rl.apps.study.recruiters import (
    CODES_FILE,
    UnknownRecruitError,
    is_known_code,
    recruit_of,
    way_out,
    write_codes,
)

PROLIFIC = {"PROLIFIC_PID": "5f1", "STUDY_ID": "s", "SESSION_ID": "x"}
SONA_CREDIT = "https://uni.sona-systems.com/webstudy_credit.aspx?experiment_id=1&credit_token=ab"


@pytest.mark.parametrize(
    ("name", "parameters", "external", "fields"),
    [
        ("prolific", {**PROLIFIC, "more": "1"}, "5f1", PROLIFIC),
        ("prolific", {"PROLIFIC_PID": "5f1"}, "5f1", {"PROLIFIC_PID": "5f1", "STUDY_ID": "", "SESSION_ID": ""}),
        ("sona", {"survey_code": "77"}, "77", {"survey_code": "77"}),
        (
            "mturk",
            {"workerId": "W", "assignmentId": "A", "hitId": "H"},
            "W",
            {"workerId": "W", "assignmentId": "A", "hitId": "H"},
        ),
        ("codes", {"code": "k7"}, "k7", {"code": "k7"}),
    ],
)
def test_who_comes(name: str, parameters: dict[str, str], external: str, fields: dict[str, str]) -> None:
    assert recruit_of(name, parameters) == (external, fields)


@pytest.mark.parametrize("given", [{}, {"PROLIFIC_PID": ""}, {"PROLIFIC_PID": "{{%PROLIFIC_PID%}}"}, {"code": "k"}])
def test_an_address_without_the_id_lets_nobody_in(given: dict[str, str]) -> None:
    with pytest.raises(UnknownRecruitError, match="the address has no PROLIFIC_PID"):
        recruit_of("prolific", given)


def test_an_id_is_not_endless() -> None:
    assert recruit_of("codes", {"code": "k" * 128})
    with pytest.raises(UnknownRecruitError):
        recruit_of("codes", {"code": "k" * 129})


CODES = {"finished": "C1", "screened_out": "C2", "no_consent": "C3"}


@pytest.mark.parametrize(("ended", "code"), [("finished", "C1"), ("screened_out", "C2"), ("no_consent", "C3")])
def test_prolific_gets_the_code_of_the_way_out(ended: str, code: str) -> None:
    address = f"https://app.prolific.com/submissions/complete?cc={code}"
    assert way_out("prolific", ended, CODES, PROLIFIC) == {"code": code, "address": address}


@pytest.mark.parametrize("ended", ["withdrawn", "", "unknown"])
def test_who_left_otherwise_has_no_code(ended: str) -> None:
    assert way_out("prolific", ended, CODES, PROLIFIC) == {"code": "", "address": ""}


def test_sona_gets_its_own_code_back_and_shows_none() -> None:
    ways = {"finished": SONA_CREDIT, "screened_out": "", "no_consent": ""}
    out = way_out("sona", "finished", ways, {"survey_code": "7 7&"})
    assert out == {"code": "", "address": f"{SONA_CREDIT}&survey_code=7%207%26"}
    assert way_out("sona", "no_consent", ways, {"survey_code": "77"}) == {"code": "", "address": ""}


@pytest.mark.parametrize("name", ["mturk", "codes"])
def test_others_show_the_code(name: str) -> None:
    assert way_out(name, "finished", CODES, {"code": "k"}) == {"code": "C1", "address": ""}
    assert way_out(name, "finished", {}, {"code": "k"}) == {"code": "", "address": ""}


def test_a_laboratory_lists_its_codes(tmp_path: Path) -> None:
    assert is_known_code(tmp_path, "any")
    codes = write_codes(tmp_path, 30).read_text().split()
    assert len(set(codes)) == 30
    assert {len(code) for code in codes} == {8}
    assert all(is_known_code(tmp_path, code) for code in codes)
    assert not is_known_code(tmp_path, "any")
    assert not is_known_code(tmp_path, "")
    assert write_codes(tmp_path, 5) == tmp_path / CODES_FILE
    assert (tmp_path / CODES_FILE).read_text().split() == codes  # those that were handed out stay
