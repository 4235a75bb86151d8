"""The server keeps what fits before it confirms it, refuses the rest, and logs nothing about anybody."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from aiohttp import ClientResponse
from aiohttp.test_utils import TestClient, TestServer
from own_study import right_value, write_study

from ibe_rl.apps.study import joint_writer
from ibe_rl.apps.study.answers import FILE, Answers, Person
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.messages import MAX_ANSWER_BYTES
from ibe_rl.apps.study.recruiters import write_codes
from ibe_rl.apps.study.server import study_app
from ibe_rl.apps.study.sitting import position


@dataclass
class Visit:
    """A client of the real server, and what lies behind it."""

    client: TestClient[Any, Any]
    study: Study
    answers: Answers
    address: str = ""
    now: dict[str, Any] = field(default_factory=dict)

    async def send(self, path: str, body: Any, **headers: str) -> tuple[int, dict[str, Any]]:
        data = body if isinstance(body, str | bytes) else json.dumps(body)
        return await read(await self.client.post(path, data=data, headers=headers))

    async def get(self, path: str) -> tuple[int, dict[str, Any]]:
        return await read(await self.client.get(path))

    async def begin(self, **parameters: str) -> Person:
        """Come in with a code and see the first page."""
        _, reply = await self.send("/begin", parameters or {"code": "k1"})
        self.address = reply["address"]
        _, self.now = await self.get(f"{self.address}/now")
        return self.person

    @property
    def person(self) -> Person:
        person = self.answers.person(self.address.removeprefix("/p/"))
        assert person is not None
        return person

    def message(self, **changes: Any) -> dict[str, Any]:
        """The answer that fits the page where the person is."""
        at = position(self.study, self.answers, self.person)
        assert at.page is not None
        value = right_value(self.study, at.page)
        fits = {"page": at.page.name, "attempt": at.attempt, "value": value, "took_ms": 900, "hidden_ms": 0}
        return {**fits, **changes}

    async def answer(self, message: Any = None, **headers: str) -> tuple[int, dict[str, Any]]:
        status, reply = await self.send(f"{self.address}/answer", message or self.message(), **headers)
        self.now = reply.get("now", self.now)
        return status, reply


async def read(response: ClientResponse) -> tuple[int, dict[str, Any]]:
    return response.status, await response.json()


Visited = Callable[[Callable[[Visit], Awaitable[None]]], None]


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return open_study(write_study(tmp_path / "study"))


@pytest.fixture
def visited(study: Study) -> Iterator[Visited]:
    """Run a visit against the server of a study."""
    answers = Answers(study.folder / FILE)

    async def visit(what: Callable[[Visit], Awaitable[None]]) -> None:
        server = TestServer(study_app(study, answers))
        await server.start_server(access_log=None)  # as it is served
        async with TestClient(server) as client:
            await what(Visit(client, study, answers))

    yield lambda what: asyncio.run(visit(what))
    answers.close()


def test_from_the_address_to_the_end(visited: Visited) -> None:
    async def walk(visit: Visit) -> None:
        person, seen = await visit.begin(), []
        while "page" in visit.now:
            seen.append(visit.now["kind"])
            status, reply = await visit.answer()
            assert (status, reply["became"]) == (200, "taken")
            assert len(visit.answers.answers_of(person)) == len(seen)  # on disk once it is confirmed
            assert (reply["feedback"] is None) == ("practice" not in visit.answers.answers_of(person)[-1].page)
        assert visit.now == {"ended": "finished", "code": "", "address": ""}
        assert (await visit.get(f"{visit.address}/now"))[1]["ended"] == "finished"
        assert visit.person.ended == "finished"

    visited(walk)


def test_what_a_trial_is_sent_has_nothing_of_its_end(visited: Visited) -> None:
    async def look(visit: Visit) -> None:
        await visit.begin()
        while visit.now["kind"] != "trial":
            await visit.answer()
        assert not {"truth", "later", "observers"} & set(json.dumps(visit.now).split('"'))

    visited(look)


def test_parts_and_words(visited: Visited) -> None:
    async def look(visit: Visit) -> None:
        for path in ("/", "/p/nobody", "/part/page.js", "/part/trial.js", "/part/draw.js", "/part/page.css"):
            response = await visit.client.get(path)
            assert response.status == 200
            assert "default-src 'self'" in response.headers["Content-Security-Policy"]
            assert "http" not in (await response.text()).replace("http-equiv", "")  # nothing of another site
        assert (await visit.get("/about"))[1]["words"]["next"] == "next"
        for path in ("/part/server.py", "/part/../page.js", "/p/nobody/now", "/nothing"):
            status, reply = await visit.get(path)
            assert status == 404
            assert "refused" in reply

    visited(look)


def test_a_foreign_site_may_not_answer(visited: Visited) -> None:
    async def attack(visit: Visit) -> None:
        await visit.begin()
        for path in ("/begin", f"{visit.address}/answer", f"{visit.address}/withdraw"):
            status, reply = await visit.send(path, visit.message(), Origin="https://example.org")
            assert (status, reply["refused"]) == (403, "only the page of this study may send")
        assert visit.answers.answers_of(visit.person) == []
        own = f"http://{visit.client.host}:{visit.client.port}"
        assert (await visit.answer(Origin=own))[0] == 200

    visited(attack)


def test_a_secret_of_nobody(visited: Visited) -> None:
    async def guess(visit: Visit) -> None:
        person = await visit.begin()
        message = visit.message()
        for token in (person.token[:-1], person.token.lower(), str(person.number), "%00"):
            assert (await visit.get(f"/p/{token}/now"))[0] == 404
            assert (await visit.send(f"/p/{token}/answer", message))[0] == 404
            assert (await visit.send(f"/p/{token}/withdraw", {}))[0] == 404
        assert visit.answers.answers_of(person) == []

    visited(guess)


BAD: list[Any] = ["", "{", "[]", "null", b"\xff\xfe", "[" * 60_000, {"page": "consent"}, '{"page": NaN}']


@pytest.mark.parametrize("body", BAD)
def test_no_answer_at_all_is_refused_and_the_page_stays(visited: Visited, body: Any) -> None:
    async def send(visit: Visit) -> None:
        await visit.begin()
        status, reply = await visit.send(f"{visit.address}/answer", body)
        assert (status, reply["now"]["page"]) == (409, "consent")
        assert (await visit.answer())[0] == 200

    visited(send)


def test_too_much_is_refused(visited: Visited) -> None:
    async def send(visit: Visit) -> None:
        await visit.begin()
        for path in ("/begin", f"{visit.address}/answer"):
            status, reply = await visit.send(path, "x" * (MAX_ANSWER_BYTES + 1))
            assert status == 413
            assert "refused" in reply

    visited(send)


def test_twice_out_of_order_and_too_late(visited: Visited) -> None:
    async def send(visit: Visit) -> None:
        await visit.begin()
        first = visit.message()
        later = {**first, "page": "debriefing", "value": {}}
        status, reply = await visit.answer(later)
        assert (status, reply["now"]["page"]) == (409, "consent")
        assert (await visit.answer(first))[1]["became"] == "taken"
        assert (await visit.answer({**first, "value": {"agrees": False}}))[1]["became"] == "answered before"
        assert visit.now["page"] == "demographics"
        assert (await visit.answer(visit.message(value={"more": 1})))[0] == 409
        while "page" in visit.now:
            await visit.answer()
        status, reply = await visit.answer({**first, "page": "comment", "attempt": 2, "value": {"text": ""}})
        assert (status, reply["now"]["ended"]) == (409, "finished")

    visited(send)


def test_who_withdraws_is_gone(visited: Visited) -> None:
    async def leave(visit: Visit) -> None:
        person = await visit.begin()
        await visit.answer()
        _, reply = await visit.send(f"{visit.address}/withdraw", {})
        assert reply["now"]["ended"] == "withdrawn"
        assert (await visit.get(f"{visit.address}/now"))[0] == 404
        assert visit.answers.answers_of(person) == []

    visited(leave)


@pytest.mark.parametrize("body", ["", "[]", "[" * 60_000, {}, {"code": 3}, {"code": ""}, {"other": "k"}])
def test_without_a_code_nobody_comes_in(visited: Visited, body: Any) -> None:
    async def come(visit: Visit) -> None:
        assert await visit.send("/begin", body) == (400, {"refused": "refused_id"})
        assert visit.answers.people(pilots=True) == []

    visited(come)


def test_codes_of_a_laboratory_count_once(visited: Visited, study: Study) -> None:
    code = write_codes(study.folder, 2).read_text().split()[0]

    async def come(visit: Visit) -> None:
        assert await visit.send("/begin", {"code": "guessed"}) == (400, {"refused": "refused_id"})
        first = await visit.begin(code=code)
        assert await visit.begin(code=code) == first
        assert len(visit.answers.people()) == 1

    visited(come)


def test_no_more_than_the_quota_and_nobody_once_it_is_stopped(visited: Visited) -> None:
    async def come(visit: Visit) -> None:
        visit.answers.recruiting = False
        assert await visit.send("/begin", {"code": "k1"}) == (409, {"refused": "refused_full"})
        visit.answers.recruiting = True
        for number in range(6):
            await visit.begin(code=f"k{number}")
        assert await visit.send("/begin", {"code": "k6"}) == (409, {"refused": "refused_full"})
        visit.answers.recruiting = False
        assert (await visit.begin(code="k5")).number == 6  # who has begun comes in again
        assert (await visit.begin(code="p", pilot="1")).pilot

    visited(come)


def test_pilots_come_to_the_server_s_own_address(visited: Visited) -> None:
    async def come(visit: Visit) -> None:
        status, reply = await visit.send("/begin", {"code": "p", "pilot": "1"}, Host="study.example.org")
        assert (status, reply["refused"]) == (403, "refused_pilot")
        assert visit.answers.people(pilots=True) == []

    visited(come)


PROLIFIC = {"recruiter": "prolific", "completion_codes": {"finished": "C1", "screened_out": "C2", "no_consent": "C3"}}


def test_an_id_takes_part_in_one_session_and_goes_back_with_its_code(tmp_path: Path) -> None:
    answers = Answers(tmp_path / FILE)
    study = open_study(write_study(tmp_path / "study", **PROLIFIC))

    async def come() -> None:
        async with TestClient(TestServer(study_app(study, answers))) as client:
            visit = Visit(client, study, answers)
            sent = {"PROLIFIC_PID": "p", "STUDY_ID": "s", "SESSION_ID": "1"}
            person = await visit.begin(**sent)
            assert await visit.send("/begin", {**sent, "SESSION_ID": "2"}) == (409, {"refused": "refused_begun"})
            assert await visit.begin(**sent) == person
            await visit.answer(visit.message(value={"agrees": False}))
            address = "https://app.prolific.com/submissions/complete?cc=C3"
            assert visit.now == {"ended": "no_consent", "code": "C3", "address": address}

    asyncio.run(come())
    answers.close()


def test_the_log_has_no_ids_no_secrets_and_no_answers(
    visited: Visited, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger("ibe_rl.study"), "disabled", True)  # as hydra leaves it in this process

    async def send(visit: Visit) -> None:
        person = await visit.begin(code="their-own-id")
        await visit.send("/begin", {"code": "x" * 999})
        await visit.answer(visit.message(value={"agrees": "their-own-words"}))
        await visit.get(f"/p/{person.token}x/now")
        await visit.send(f"{visit.address}/answer", "their-own-words", Origin="https://their-own-site")
        said = caplog.text
        assert said.count("refused: ") == 4
        for secret in ("their-own", person.token, "127.0.0.1", visit.client.host):
            assert secret not in said

    with caplog.at_level(logging.DEBUG, logger="ibe_rl.study"):
        visited(send)


def test_a_failure_is_answered_and_logged_without_what_was_said(
    visited: Visited, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise RuntimeError("their own words")

    async def send(visit: Visit) -> None:
        await visit.begin()
        message = visit.message()
        monkeypatch.setattr(joint_writer, "take", fail)
        assert (await visit.answer(message))[0] == 500  # the page tries again
        monkeypatch.undo()
        assert (await visit.answer(message))[1]["became"] == "taken"

    visited(send)
    assert "failed: RuntimeError in test_study_server.py" in caplog.text
    assert "their own words" not in caplog.text
