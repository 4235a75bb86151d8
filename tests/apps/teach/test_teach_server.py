"""The server of the lesson's page, with real connections: what pages may do to each other and to the training."""

from __future__ import annotations

import json
import logging
import socket
import threading
import time
from collections.abc import Iterator

import pytest
from clients import Client, Room, eventually, open_room
from websockets.exceptions import ConnectionClosed, InvalidStatus

from ibe_rl.apps.teach import server
from ibe_rl.apps.teach.messages import MAX_BYTES
from ibe_rl.apps.teach.server import MAX_A_SECOND, MAX_BAD, MAX_PAGES, SECURITY, Server, is_ours
from ibe_rl.apps.teach.session import TeachingSession
from ibe_rl.runtime.ports import HOST

PICTURE = "x" * 3_000


@pytest.fixture
def room(capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> Iterator[Room]:
    """A server that has printed and logged nothing by the end, whatever was done to it."""
    with open_room() as made:
        yield made
    assert eventually(lambda: not any(thread.name == "classroom" for thread in threading.enumerate()))
    assert capfd.readouterr() == ("", "")
    assert [record for record in caplog.records if record.levelno >= logging.INFO] == []


PARTS = {
    "/": ("text/html", b"page.js"),
    "/page.js": ("text/javascript", b"WebSocket"),
    "/page.css": ("text/css", b"body"),
    "/?a=b": ("text/html", b"page.js"),
}


def test_the_page_and_its_parts(room: Room):
    for path, (kind, part) in PARTS.items():
        answer, body = room.get(path)
        assert (answer.status, answer.headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")
        assert part in body
        assert {name: answer.headers[name] for name in SECURITY} == SECURITY


def test_nothing_else_is_there(room: Room):
    for path in ("/page.html", "/../server.py", "//", "/%2e%2e/desk.py", "/lesson/"):
        assert room.get(path)[0].status == 404


def test_a_name_that_only_points_here_is_refused(room: Room):
    """A page of somebody else's whose name turns into 127.0.0.1 (DNS rebinding) is of one origin with itself."""
    there = f"evil.example:{room.port}"
    for path in ("/", "/page.js", "/lesson"):
        assert room.get(path, Host=there, Origin=f"http://{there}")[0].status == 403


def test_only_the_page_of_the_server_may_instruct(room: Room):
    for origin in (None, "null", "http://evil.example", f"http://{HOST}", f"https://{HOST}:{room.port}"):
        with pytest.raises(InvalidStatus) as refused:
            room.page(origin=origin)
        assert refused.value.response.status_code == 403
    assert room.desk.chair is None


def test_a_request_without_or_with_two_hosts_is_refused(room: Room):
    for hosts in (b"", f"Host: {HOST}:{room.port}\r\n".encode() * 2):
        with room.raw(b"GET / HTTP/1.1\r\n" + hosts + b"\r\n") as stranger:
            assert stranger.recv(100).split()[1] in (b"400", b"403")


def test_which_names_are_ours():
    ours = ("localhost", "LOCALHOST:8765", "127.0.0.1", "127.0.0.1:1", "[::1]:8765", "10.0.0.7", socket.gethostname())
    others = ("", ":80", "evil.example", "localhost.evil.example:80", "127.0.0.1.nip.io", "teacher.lan:8765", "a b")
    assert [name for name in ours if not is_ours(name)] == []
    assert [name for name in others if is_ours(name)] == []
    assert is_ours("Teacher.lan:8765", bound="teacher.lan")


def test_the_first_instructs_the_second_watches_and_may_sit_when_the_chair_is_free(room: Room):
    first, second = room.seated(), room.page()
    assert second.until("seat") == {"kind": "seat", "instructs": False, "free": False, "pages": 2}
    assert first.until("seat", lambda seat: seat["pages"] == 2)["instructs"]
    second.say("press", sequence=1, episode=0, value=1.0)
    assert second.until("refused")["why"] == "watching"
    second.say("sit")
    assert second.until("refused")["why"] == "watching"
    first.close()
    assert not second.until("seat", lambda seat: seat["free"])["instructs"]
    second.say("sit")
    assert second.until("seat", lambda seat: seat["instructs"])["pages"] == 1
    second.say("press", sequence=1, episode=0, value=1.0)
    assert eventually(lambda: room.desk.take().value == 1.0)


def test_a_page_is_not_made_to_instruct_without_asking(room: Room):
    first, second = room.seated(), room.page()
    second.until("seat")
    first.close()
    second.until("seat", lambda seat: seat["free"])
    assert room.desk.chair is None


def test_controls_reach_every_page_and_those_that_come_later(room: Room):
    first, second = room.seated(), room.page()
    first.say("speed", times=4)
    first.say("oracle", on=True)
    first.say("pause", on=True)
    now = {"kind": "controls", "paused": True, "speed": 4.0, "oracle": True}
    for page in (first, second, room.page()):
        assert page.until("controls", lambda controls: controls["paused"]) == now
    first.close()
    assert not second.until("controls", lambda controls: not controls["paused"])["paused"]


BAD = ["", "{", "[]", '"press"', "{}", '{"kind":"run"}', '{"kind":"sit","x":1}', '{"kind":"pause","on":1}', b"\x00\xff"]
BAD += ['{"kind":"press","sequence":1,"episode":0,"value":2}', '{"kind":"speed","times":' + "9" * 400 + "}"]


def test_a_malformed_message_is_refused_and_the_page_goes_on(room: Room):
    for text in BAD:
        page = room.page()
        assert page.until("seat")["instructs"]
        page.socket.send(text)
        assert page.until("refused")["why"]
        page.say("press", sequence=1, episode=0, value=-1.0)
        assert eventually(lambda: room.desk.take().value == -1.0)
        page.close()
        assert eventually(lambda: room.desk.chair is None)


def test_a_page_that_sends_nothing_else_is_closed(room: Room):
    page, other = room.seated(), room.page()
    for _ in range(MAX_BAD):
        page.socket.send("{")
        page.until("refused")
    assert room.desk.chair == 1
    page.socket.send("{")
    assert page.closing() == (1003, "these are not the messages of this page")
    assert other.until("seat", lambda seat: seat["free"])["pages"] == 1


def test_a_huge_message_closes_only_its_page(room: Room):
    huge, other = room.seated(), room.page()
    huge.socket.send(" " * (MAX_BYTES + 1))
    assert huge.closing()[0] == 1009
    other.until("seat", lambda seat: seat["free"])
    room.server.post("frame", {"step": 1})
    assert other.until("frame")["step"] == 1


def test_a_flood_closes_only_its_page(room: Room):
    calm, flood = room.seated(), room.page()
    with pytest.raises(ConnectionClosed):  # noqa: PT012 - which message it is that fails is not known
        for _ in range(50 * MAX_A_SECOND):
            flood.say("sit")
        flood.closing()
        raise AssertionError("the flood went through")
    assert flood.socket.close_code == 1008
    calm.say("press", sequence=1, episode=0, value=1.0)
    assert eventually(lambda: room.desk.take().value == 1.0)


def test_a_flood_that_reads_nothing_leaves_the_chair_at_once(room: Room, monkeypatch: pytest.MonkeyPatch):
    """Before its connection is closed, which waits for its goodbye."""
    monkeypatch.setattr(server, "STOP_S", 200.0)  # longer than this test waits for anything
    flood = room.seated()
    watcher = room.page()
    flood.say("press", sequence=1, episode=0, value=1.0)
    assert eventually(lambda: room.desk.take().value == 1.0)
    frame = b"\x81\x8e" + b"\0\0\0\0" + b'{"kind":"sit"}'
    flood.socket.socket.sendall(frame * (MAX_A_SECOND + 50))
    watcher.until("seat", lambda seat: seat["free"])
    assert room.desk.take().value is None
    flood.kill()


def test_so_many_pages_and_no_more(room: Room):
    pages = [room.page() for _ in range(MAX_PAGES)]
    pages[-1].until("seat", lambda seat: seat["pages"] == MAX_PAGES)
    with pytest.raises(InvalidStatus) as refused:
        room.page()
    assert refused.value.response.status_code == 503
    pages[3].close()
    pages[0].until("seat", lambda seat: seat["pages"] == MAX_PAGES - 1)
    room.page().until("seat", lambda seat: seat["pages"] == MAX_PAGES)


@pytest.mark.parametrize("reset", [False, True])
def test_a_page_that_is_killed_frees_the_chair_and_what_it_pressed(room: Room, reset: bool):
    first, second = room.seated(), room.page()
    first.say("press", sequence=1, episode=0, value=1.0)
    first.say("pause", on=True)
    assert eventually(lambda: room.desk.take().value == 1.0 and room.desk.controls.paused)
    first.kill(reset)
    second.until("seat", lambda seat: seat["free"])
    assert room.desk.take().value is None
    assert not room.desk.controls.paused


def test_a_slow_page_holds_nobody_up_and_then_sees_the_newest(room: Room):
    slow, other = room.page(max_queue=1), room.page()
    other.until("seat")
    longest, last, seen = 0.0, 4_000, [0]
    reader = threading.Thread(target=lambda: _read_to(other, last, seen))
    reader.start()
    for number in range(1, last + 1):
        start = time.perf_counter()
        room.server.post("frame", {"step": number, "picture": PICTURE})
        longest = max(longest, time.perf_counter() - start)
        if number % 10 == 0:
            time.sleep(0.001)
    reader.join(120)
    assert seen[-1] == last
    assert longest < 4  # a slow page is waited for no longer than PING_S
    waiting = room.server._waiting[1]
    assert sum(map(len, waiting.values())) < 10_000
    steps = [0]
    _read_to(slow, last, steps)
    assert steps[-1] == last
    assert len(steps) < 400, "of what it missed it has to read through a second or two, not through half a minute"
    assert steps == sorted(set(steps))


def _read_to(page: Client, last: int, steps: list[int]) -> None:
    while steps[-1] < last:
        steps.append(page.until("frame")["step"])


def test_a_page_that_asks_for_more_than_there_is_gets_what_there_is(room: Room):
    page = room.page(subprotocols=["chat"], compression="deflate")
    assert page.until("seat")["instructs"]
    assert page.socket.subprotocol is None


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: "])
def test_a_connection_that_asks_for_nothing_is_closed(monkeypatch: pytest.MonkeyPatch, sent: bytes):
    monkeypatch.setattr(server, "OPEN_S", 0.5)
    with open_room() as room, room.raw(sent) as stranger:
        assert stranger.recv(1) == b""


@pytest.mark.parametrize("frames", [0, 400])
def test_a_page_that_answers_no_ping_frees_the_chair(room: Room, monkeypatch: pytest.MonkeyPatch, frames: int):
    monkeypatch.setattr(server, "PING_S", 1.0)
    with room.raw(handshake(room.port)):
        assert eventually(lambda: room.desk.chair == 1)
        for number in range(frames):  # more than is kept for it
            room.server.post("frame", {"step": number, "picture": PICTURE})
        start = time.monotonic()
        assert room.page().until("seat", lambda seat: seat["free"])["pages"] == 1
        assert time.monotonic() - start < 20


def handshake(port: int) -> bytes:
    lines = (
        "GET /lesson HTTP/1.1",
        f"Host: {HOST}:{port}",
        f"Origin: http://{HOST}:{port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
    )
    return "".join(f"{line}\r\n" for line in (*lines, "")).encode()


GARBAGE = [
    b"\x00\xff" * 500,
    b"GET / HTTP/1.1\r\nHost: ",
    b"POST / HTTP/1.1\r\n\r\n",
    b"GET /" + b"a" * 20_000,
    b"GET /lesson HTTP/1.1\r\n" + b"Some: thing\r\n" * 1_000 + b"\r\n",
    b"\r\n\r\n",
]


@pytest.mark.parametrize("sent", GARBAGE)
def test_garbage_half_a_handshake_and_silence_disturb_nobody(room: Room, sent: bytes):
    with room.raw(sent), room.raw():
        page = room.seated()
        page.say("press", sequence=1, episode=0, value=1.0)
        assert eventually(lambda: room.desk.take().value == 1.0)
    with room.raw(sent) as stranger:
        stranger.shutdown(socket.SHUT_WR)
    page.say("release", sequence=2, episode=0)
    assert eventually(lambda: room.desk.take().value is None)


def test_garbage_after_the_handshake_closes_only_that_page(room: Room):
    page, other = room.seated(), room.page()
    page.socket.socket.sendall(b"\xff" * 100)
    assert page.closing()[0] == 1002
    assert other.until("seat", lambda seat: seat["free"])["pages"] == 1


def test_a_port_that_is_taken(room: Room):
    with pytest.raises(OSError, match="address already in use"):
        Server(TeachingSession((0.0,), 0, None), HOST, room.port)


def test_the_farewell_arrives_even_if_some_pages_do_not_answer(room: Room):
    page = room.seated()
    room.page(max_queue=1)
    with room.raw(), room.raw(b"GET / HTTP/1.1\r\n"):
        for number in range(300):
            room.server.post("frame", {"step": number, "picture": PICTURE})
        room.server.post("farewell", {"text": "over"})
        room.server.close()
        assert eventually(lambda: not room.server._thread.is_alive())
    assert page.until("farewell")["text"] == "over"
    assert page.closing()[0] == 1001
    room.server.post("frame", {"step": 0})
    room.server.close()
    with pytest.raises(OSError):  # noqa: PT011 - refused, reset
        room.raw()


def test_nobody_waits_for_a_page_that_says_goodbye(room: Room, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(server, "STOP_S", 60.0)
    page = room.seated()
    reader = threading.Thread(target=page.closing)
    reader.start()
    start = time.monotonic()
    room.server.close()
    assert time.monotonic() - start < 30
    reader.join(60)
    assert page.socket.close_code == 1001


def test_the_newest_of_each_kind_is_told_to_a_page_that_comes_later(room: Room):
    for step in range(3):
        room.server.post("frame", {"step": step})
    room.server.post("scene", {"episode": 5})
    page = room.page()
    messages = [page.next() for _ in range(4)]
    assert {message["kind"] for message in messages} == {"frame", "scene", "seat", "controls"}
    assert [message["step"] for message in messages if message["kind"] == "frame"] == [2]


def test_a_number_that_json_has_not_is_not_sent_and_hurts_nobody(room: Room):
    page = room.seated()
    room.server.post("frame", {"return": float("nan")})
    room.server.post("frame", {"return": 1.0})
    assert json.dumps(page.until("frame")["return"]) == "1.0"
