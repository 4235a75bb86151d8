"""The admin page shows how many are where, stops and resumes recruiting, and is reached from this machine alone."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from aiohttp.test_utils import TestClient, TestServer
from own_study import write_study

from ibe_rl.apps.study.admin import admin_app, state_of_study
from ibe_rl.apps.study.answers import FILE, Answer, Answers
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.sitting import enter

Desk = tuple[Study, Answers]


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    answers = Answers(tmp_path / FILE)
    yield open_study(write_study(tmp_path / "study")), answers
    answers.close()


def test_people_are_counted_by_arm_and_page_and_pilots_apart(desk: Desk) -> None:
    people = [enter(*desk) for _ in range(4)]
    enter(*desk, pilot=True)
    of_arm = {arm: [one for one in people if one.arms == (arm,)] for arm in ("none", "ibe")}
    desk[1].keep(of_arm["none"][0], Answer("consent", 1, {"agrees": True}, 1, 0))
    desk[1].end(of_arm["ibe"][0], "finished")
    state = state_of_study(*desk)
    none, ibe = state["people"]
    assert (none["arms"], ibe["arms"]) == (["none"], ["ibe"])
    assert none["states"]["under_way"] == 2
    assert none["last_page"] == {"consent": 1, "": 1}
    assert (ibe["states"]["finished"], ibe["states"]["under_way"], ibe["last_page"]) == (1, 1, {"": 1})
    assert sum(row["states"]["under_way"] for row in state["pilots"]) == 1
    assert (state["quota"], state["recruiting"]) == (6, True)


def test_it_holds_neither_answers_nor_ids(desk: Desk) -> None:
    person = enter(*desk, recruiter="prolific", external="their-id")
    desk[1].keep(person, Answer("comment", 1, {"text": "their words"}, 1, 0))
    text = json.dumps(state_of_study(*desk))
    assert "their" not in text
    assert person.token not in text


def asked(desk: Desk, method: str, path: str, body: str = "", **headers: str) -> tuple[int, Any]:
    """Ask the admin server."""

    async def ask() -> tuple[int, Any]:
        async with TestClient(TestServer(admin_app(*desk))) as client:
            response = await client.request(method, path, data=body, headers=headers)
            return response.status, await response.text()

    status, text = asyncio.run(ask())
    return status, json.loads(text) if text.startswith("{") else text


def test_recruiting_is_stopped_and_resumed(desk: Desk) -> None:
    assert asked(desk, "POST", "/recruiting", '{"recruiting": false}')[1]["recruiting"] is False
    assert not desk[1].recruiting
    assert asked(desk, "GET", "/state")[1]["recruiting"] is False
    assert asked(desk, "POST", "/recruiting", '{"recruiting": true}')[1]["recruiting"] is True
    assert desk[1].recruiting


@pytest.mark.parametrize("body", ["", "[]", "{}", '{"recruiting": 0}', "[" * 900])
def test_another_switch_is_refused(desk: Desk, body: str) -> None:
    assert asked(desk, "POST", "/recruiting", body) == (400, {"refused": "recruiting is true or false"})
    assert desk[1].recruiting


@pytest.mark.parametrize("headers", [{"Host": "admin.example.org"}, {"Origin": "https://example.org"}])
def test_other_sites_reach_nothing(desk: Desk, headers: dict[str, str]) -> None:
    assert asked(desk, "POST", "/recruiting", '{"recruiting": false}', **headers)[0] == 403
    assert desk[1].recruiting


def test_the_page_and_its_parts(desk: Desk) -> None:
    for path in ("/", "/admin.js", "/part/page.css"):
        assert asked(desk, "GET", path)[0] == 200
    assert asked(desk, "GET", "/begin")[0] == 404
