"""Whatever comes, in whatever order: no confirmed answer is lost or doubled, nothing fails, and the page is right."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from aiohttp.test_utils import TestClient, TestServer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from own_study import right_value, write_study

from ibe_rl.apps.study.answers import FILE, Answer, Answers, Person
from ibe_rl.apps.study.folder import Study, open_study
from ibe_rl.apps.study.messages import MAX_ANSWER_BYTES
from ibe_rl.apps.study.server import study_app
from ibe_rl.apps.study.sitting import enter, position, schedule_of

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
FIELDS = st.fixed_dictionaries(
    {
        "page": st.sampled_from(["consent", "instructions", "trial/1/1", "trial/2/2", "debriefing", "attention/1"]),
        "attempt": st.integers(-1, 3),
        "value": st.dictionaries(
            st.sampled_from(["at", "choice", "choices", "agrees", "confidence"]), JSON, max_size=3
        ),
        "took_ms": st.integers(-1, 2**70),
        "hidden_ms": st.just(0),
    }
)
BODY = st.one_of(st.binary(max_size=60), JSON.map(json.dumps), FIELDS.map(json.dumps), st.just("[" * 60_000))
ACTS = st.one_of(
    st.sampled_from(["right"] * 6 + ["again", "other value", "ahead", "next attempt", "three at once", "reload"]),
    st.sampled_from(["declines", "wrong", "huge", "foreign", "withdraws", "stays away", "restart"]),
    BODY,
)


@dataclass
class Guest:
    """Somebody who takes part, and what the server has confirmed to them."""

    person: Person
    confirmed: list[Answer] = field(default_factory=list)
    withdrawn: bool = False

    @property
    def path(self) -> str:
        return f"/p/{self.person.token}"


class House:
    """The real server of a study; ``answers`` reads its file as somebody else would, who sees only what is on disk."""

    def __init__(self, study: Study, path: Path):
        self.study, self.path, self.answers = study, path, Answers(path)

    async def open(self) -> None:
        self._served = Answers(self.path)
        self.client: TestClient[Any, Any] = TestClient(TestServer(study_app(self.study, self._served)))
        await self.client.start_server()

    async def restart(self) -> None:
        """What a killed server had not put on disk is gone."""
        await self.client.close()
        self._served._store.close()
        await self.open()

    async def close(self) -> None:
        await self.client.close()
        self._served.close()
        self.answers.close()

    async def ask(self, path: str, body: Any = None) -> tuple[int, dict[str, Any]]:
        data = body if isinstance(body, str | bytes | None) else json.dumps(body)
        async with self.client.request("GET" if body is None else "POST", path, data=data) as reply:
            assert reply.status < 500, (path, body)
            return reply.status, await reply.json()

    async def give(self, guest: Guest, answer: Answer) -> None:
        """Send an answer and note what is confirmed."""
        status, reply = await self.ask(f"{guest.path}/answer", asdict(answer))
        noted = {(one.page, one.attempt) for one in guest.confirmed}
        if status == 200:
            assert (reply["became"] == "answered before") == ((answer.page, answer.attempt) in noted)
            guest.confirmed += [answer] if reply["became"] == "taken" else []

    def fitting(self, guest: Guest) -> Answer | None:
        """The answer that the server should take now."""
        person = self.answers.person(guest.person.token)
        at = position(self.study, self.answers, person) if person else None
        if at is None or at.page is None:
            return None
        return Answer(at.page.name, at.attempt, right_value(self.study, at.page), 1000, 0)

    async def check(self, guest: Guest) -> None:
        """What is on disk is what was confirmed; the page is the first that was not answered."""
        assert self.answers.answers_of(guest.person) == ([] if guest.withdrawn else guest.confirmed)
        status, now = await self.ask(f"{guest.path}/now")
        assert status == (404 if guest.withdrawn else 200)
        if "page" in now:
            answered = {one.page for one in guest.confirmed}
            names = [page.name for page in schedule_of(self.study, guest.person)]
            assert answered.issuperset(names[: names.index(now["page"])])
            assert (now["page"], now["attempt"]) not in {(one.page, one.attempt) for one in guest.confirmed}


async def right(house: House, guest: Guest) -> None:
    if answer := house.fitting(guest):
        await house.give(guest, answer)


async def wrong(house: House, guest: Guest) -> None:
    answer = house.fitting(guest)
    if answer and answer.page == "comprehension":
        answer = replace(answer, value={"choices": [0]})
    if answer:
        await house.give(guest, answer)


async def three_at_once(house: House, guest: Guest) -> None:
    if answer := house.fitting(guest):
        sent = [house.ask(f"{guest.path}/answer", asdict(replace(answer, took_ms=took))) for took in (1, 2, 3)]
        became = [reply["became"] for _, reply in await asyncio.gather(*sent)]
        assert sorted(became) == ["answered before", "answered before", "taken"]
        guest.confirmed.append(replace(answer, took_ms=became.index("taken") + 1))


async def again(house: House, guest: Guest, **changes: Any) -> None:
    for answer in guest.confirmed[-2:]:
        await house.give(guest, replace(answer, **changes))


async def other_page(house: House, guest: Guest, page: int, attempt: int) -> None:
    if answer := house.fitting(guest):
        names = [one.name for one in schedule_of(house.study, guest.person)]
        later = names[min(names.index(answer.page) + page, len(names) - 1)]
        await house.give(guest, replace(answer, page=later, attempt=answer.attempt + attempt))


async def declines(house: House, guest: Guest) -> None:
    answer = house.fitting(guest)
    if answer and answer.page == "consent":
        await house.give(guest, replace(answer, value={"agrees": False}))


async def huge(house: House, guest: Guest) -> None:
    status, _ = await house.ask(f"{guest.path}/answer", b'"' + b"a" * MAX_ANSWER_BYTES + b'"')
    assert status in (404, 413)


async def foreign(house: House, guest: Guest) -> None:
    for token in ("0" * 32, guest.person.token[:-1], "%00", "%ed%a0%80", "%ff"):
        status, _ = await house.ask(f"/p/{token}/answer", {"page": "consent", "value": {"agrees": True}})
        assert status == 404


async def withdraws(house: House, guest: Guest) -> None:
    status, _ = await house.ask(f"{guest.path}/withdraw", {})
    assert status == (404 if guest.withdrawn else 200)
    guest.withdrawn = True


async def stays_away(house: House, _: Guest) -> None:
    house.answers.release(-1.0)


DONE: dict[str, Callable[[House, Guest], Awaitable[None]]] = {
    "right": right,
    "wrong": wrong,
    "again": again,
    "other value": lambda house, guest: again(house, guest, value={"agrees": False}),
    "ahead": lambda house, guest: other_page(house, guest, page=1, attempt=0),
    "next attempt": lambda house, guest: other_page(house, guest, page=0, attempt=1),
    "three at once": three_at_once,
    "reload": lambda house, guest: house.check(guest),
    "declines": declines,
    "huge": huge,
    "foreign": foreign,
    "withdraws": withdraws,
    "stays away": stays_away,
    "restart": lambda house, _: house.restart(),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return open_study(write_study(tmp_path_factory.mktemp("study") / "study"))


async def act(house: House, guest: Guest, what: str | bytes) -> None:
    if what in DONE:
        await DONE[str(what)](house, guest)
        return
    status, reply = await house.ask(f"{guest.path}/answer", what)
    if status == 200 and reply["became"] == "taken":  # by chance it fits
        guest.confirmed.append(Answer(**json.loads(what)))


async def live(study: Study, folder: Path, acts: list[tuple[int, str | bytes]]) -> None:
    """Two people act in turn; after each act everything is as it should be."""
    (folder / FILE).unlink(missing_ok=True)
    house = House(study, folder / FILE)
    await house.open()
    guests = []
    for code in ("k1", "k2"):
        _, reply = await house.ask("/begin", {"code": code})
        person = house.answers.person(reply["address"].rpartition("/")[2])
        assert person is not None
        guests.append(Guest(person))
    for who, what in acts:
        await act(house, guests[who], what)
        for guest in guests:
            await house.check(guest)
    await house.close()


def test_who_withdraws_while_an_answer_is_on_its_way_leaves_nothing(study: Study, tmp_path: Path) -> None:
    async def answer_slowly() -> None:
        house = House(study, tmp_path / FILE)
        await house.open()
        person = enter(study, house.answers)
        path, withdrawn = f"/p/{person.token}", asyncio.Event()

        async def body() -> AsyncIterator[bytes]:
            yield json.dumps(asdict(Answer("consent", 1, {"agrees": True}, 1, 0))).encode()
            await withdrawn.wait()

        on_its_way = asyncio.ensure_future(house.client.post(f"{path}/answer", data=body()))
        await asyncio.sleep(0.1)
        await house.ask(f"{path}/withdraw", {})
        withdrawn.set()
        assert (await on_its_way).status == 404
        assert house.answers.answers_of(person) == []
        await house.close()

    asyncio.run(answer_slowly())


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(acts=st.lists(st.tuples(st.integers(0, 1), ACTS), min_size=5, max_size=40))
def test_any_messages(study: Study, tmp_path: Path, acts: list[tuple[int, str | bytes]]) -> None:
    asyncio.run(live(study, tmp_path, acts))


def test_all_kinds_of_messages_after_one_another(study: Study, tmp_path: Path) -> None:
    """Everything that may happen once at each page, but for the ends."""
    kinds = [kind for kind in DONE if kind not in ("declines", "withdraws", "three at once", "wrong")]
    acts: list[tuple[int, str | bytes]] = [(0, kind) for _ in range(12) for kind in kinds]
    asyncio.run(live(study, tmp_path, [*acts, (1, "three at once"), (0, "withdraws"), (0, "withdraws"), (0, "right")]))


@pytest.mark.parametrize(
    "body",
    [
        b"\xff",
        "[" * 60_000,
        "null",
        '{"code": ""}',
        '{"code": null}',
        '{"code": "\\ud800"}',
        '{"code": "\\u0000"}',
        '{"code": "\\ud800", "pilot": "1"}',
        '{"code": ["k1"]}',
        json.dumps({"code": "k" * 129}),
        json.dumps({"PROLIFIC_PID": "p"}),
    ],
)
def test_nobody_comes_in_by_accident_and_nothing_fails(study: Study, tmp_path: Path, body: str | bytes) -> None:
    async def begin() -> None:
        house = House(study, tmp_path / FILE)
        await house.open()
        status, reply = await house.ask("/begin", body)
        assert (status, "address" in reply) in ((400, False), (200, True))
        assert len(house.answers.people(pilots=True)) == (status == 200)
        await house.close()

    asyncio.run(begin())
