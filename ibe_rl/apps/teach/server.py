"""The web server of the page: loopback by default, one thread, and no connection blocks another.

Each page has a slot for the newest message of each kind. A slow page misses frames; it delays neither the environment
nor the other pages. Size and rate of incoming messages are limited before they are parsed.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import logging
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict
from importlib.resources import files
from itertools import count
from typing import Any

from aiohttp import web
from aiohttp.typedefs import Handler

from ibe_rl.apps.teach.messages import (
    MAX_BYTES,
    BadMessageError,
    CountAs,
    HandOver,
    Name,
    Pause,
    Sit,
    Speed,
    Typed,
    parse,
)
from ibe_rl.apps.teach.session import ACCEPTED, TeachingSession
from ibe_rl.task.words import Words

LESSON_PATH = "/lesson"
PAGES = {
    "/": ("page.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/drawing.js": ("drawing.js", "text/javascript"),
    "/shapes.js": ("shapes.js", "text/javascript"),
    "/words.js": ("words.js", "text/javascript"),
    "/summary.js": ("summary.js", "text/javascript"),
    "/page.css": ("page.css", "text/css"),
}
SECURITY = {
    "Content-Security-Policy": (
        "default-src 'self'; img-src data:; connect-src 'self' ws:; frame-ancestors 'none'; base-uri 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
MAX_PAGES = 16
MAX_A_SECOND = 200
"""Messages accepted from one page; a key that is held sends 2."""
MAX_BAD = 10
GOODBYE, LEAVING, NOT_OURS, TOO_MANY = 1000, 1001, 1003, 1008  # close codes of RFC 6455
PING_S = 6.0
"""Seconds of silence before a page is pinged; after half as long again it counts as gone."""
SERVER_START_S, STOP_S, CUT_S = 10.0, 2.0, 0.1
OPEN_S = 5.0
"""Seconds without a request before a connection is closed."""
UNREAD_BYTES = 1 << 15
"""Write buffer of a page that does not read; the default holds megabytes, half a minute of frames."""


class Server:
    """Serves the page and passes messages between pages and the teaching session; ``close`` it in the end.

    Args:
        desk: receives the messages of pages.
        host: to bind.
        port: to bind.

    Attributes:
        renamed: called when a page has renamed a word or added one.

    Raises:
        OSError: if the port cannot be bound.
    """

    def __init__(self, desk: TeachingSession, host: str, port: int):
        self._desk, self._host, self._port = desk, host, port
        self.renamed: Callable[[], None] = lambda: None
        self._waiting: dict[int, dict[str, str]] = {}
        self._news: dict[int, asyncio.Event] = {}
        self._newest: dict[str, str] = {}
        self._attending: set[asyncio.Task[None]] = set()
        self._numbers = count(1)
        self._loop = asyncio.new_event_loop()
        self._started, self._stop = Future[None](), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="classroom", daemon=True)
        self._thread.start()
        self._started.result(SERVER_START_S)

    def post(self, kind: str, fields: Mapping[str, Any]) -> None:
        """Send a message to all pages without blocking; a slow page gets only the newest of each kind.

        JSON has no NaN or infinity; a message with one is dropped.
        """
        with suppress(ValueError):
            text = json.dumps({"kind": kind, **fields}, separators=(",", ":"), allow_nan=False)
            self._call(self._spread, kind, text)

    def close(self) -> None:
        """Deliver what has been posted, then end."""
        self._call(self._stop.set)
        self._thread.join(2 * STOP_S)

    def _call(self, what: Callable[..., Any], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop has ended, and its pages with it
            self._loop.call_soon_threadsafe(what, *arguments)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # cancels the tasks that pages have left
            try:
                runner.run(self._serve())
            except OSError as error:  # passed to the thread that waits for the start
                self._started.set_exception(error)

    async def _serve(self) -> None:
        logging.getLogger("aiohttp").setLevel(logging.CRITICAL + 1)  # malformed requests of others are not our errors
        app = web.Application(middlewares=[self._admit])
        app.add_routes([web.get(LESSON_PATH, self._attend), *(web.get(path, _part) for path in PAGES)])
        runner = web.AppRunner(app, access_log=None, keepalive_timeout=OPEN_S, shutdown_timeout=CUT_S)
        await runner.setup()
        await web.TCPSite(runner, self._host, self._port).start()
        self._started.set_result(None)
        await self._stop.wait()
        for news in self._news.values():
            news.set()
        if self._attending:  # before the cleanup, which reads no close frame
            await asyncio.wait(self._attending, timeout=STOP_S)
        await runner.cleanup()

    @web.middleware
    async def _admit(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if not is_ours(request.headers.get("Host", ""), self._host):
            raise web.HTTPForbidden(text="this name is not this server's\n")
        return await handler(request)

    async def _attend(self, request: web.Request) -> web.WebSocketResponse:
        """Open a page's connection and serve it until it leaves."""
        if request.headers.get("Origin") != f"http://{request.headers['Host']}":
            raise web.HTTPForbidden(text="only the page of this server may instruct\n")
        if len(self._waiting) >= MAX_PAGES:
            raise web.HTTPServiceUnavailable(text=f"{MAX_PAGES} pages are open already\n")
        connection = web.WebSocketResponse(heartbeat=PING_S, max_msg_size=MAX_BYTES + 1, compress=False, writer_limit=0)
        await connection.prepare(request)
        transport = request.transport
        assert transport is not None  # a prepared response has one
        transport.set_write_buffer_limits(UNREAD_BYTES)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD_BYTES)
        self._attending.add(request.task)
        try:
            code, why = await self._converse(connection)
            async with asyncio.timeout(STOP_S):
                await connection.close(code=code, message=why.encode())
        except TimeoutError:  # no close frame
            pass
        finally:
            transport.abort()
            self._attending.discard(request.task)
        return connection

    async def _converse(self, connection: web.WebSocketResponse) -> tuple[int, str]:
        """Exchange messages with a page until it has to leave; returns the close code and reason."""
        page = next(self._numbers)
        self._waiting[page], self._news[page] = dict(self._newest), asyncio.Event()
        self._desk.join(page)
        self._seats()
        self._controls()
        talks = [asyncio.create_task(talk(connection, page)) for talk in (self._hear, self._send)]
        try:
            done, _ = await asyncio.wait(talks, return_when=asyncio.FIRST_COMPLETED)
            return done.pop().result()
        finally:  # before the close, which waits for the page's close frame: the chair is free at once
            for talk in talks:
                talk.cancel()
            del self._waiting[page], self._news[page]
            self._desk.leave(page)
            self._seats()
            self._controls()
            await asyncio.wait(talks)  # before the page's close frame is read

    async def _hear(self, connection: web.WebSocketResponse, page: int) -> tuple[int, str]:
        """Receive a page's messages until it leaves or has to; returns why."""
        allowance, at, bad = float(MAX_A_SECOND), time.monotonic(), 0
        async for message in connection:
            now = time.monotonic()
            allowance, at = min(MAX_A_SECOND, allowance + (now - at) * MAX_A_SECOND) - 1, now
            if allowance < 0:
                return TOO_MANY, "too many messages"
            try:
                self._take_in(page, message.data)
            except BadMessageError as error:
                bad += 1
                self._put(page, "refused", {"why": str(error)})
            if bad > MAX_BAD:
                return NOT_OURS, "these are not the messages of this page"
        return GOODBYE, ""

    def _take_in(self, page: int, text: str | bytes) -> None:
        message = parse(text)
        became = self._desk.hear(page, message)
        if became != ACCEPTED:
            self._put(page, "refused", {"why": became})
        elif isinstance(message, Sit):
            self._seats()
        elif isinstance(message, Pause | Speed | HandOver):
            self._controls()
        elif isinstance(message, Name | Typed | CountAs):
            self._words()

    async def _send(self, connection: web.WebSocketResponse, page: int) -> tuple[int, str]:
        """Send a page its pending messages, until the server ends."""
        news, waiting = self._news[page], self._waiting[page]
        with suppress(ConnectionError):
            while waiting or not self._stop.is_set():
                await news.wait()
                news.clear()
                while waiting:
                    await connection.send_str(waiting.pop(next(iter(waiting))))
        return LEAVING, ""

    def _spread(self, kind: str, text: str) -> None:
        self._newest[kind] = text
        for page, waiting in self._waiting.items():
            waiting[kind] = text
            self._news[page].set()

    def _put(self, page: int, kind: str, fields: Mapping[str, Any]) -> None:
        self._waiting[page][kind] = json.dumps({"kind": kind, **fields})
        self._news[page].set()

    def _seats(self) -> None:
        """Tell every page whether it instructs."""
        chair, pages = self._desk.chair, len(self._waiting)
        for page in self._waiting:
            self._put(page, "seat", {"instructs": page == chair, "free": chair is None, "pages": pages})

    def _words(self) -> None:
        """Tell every page, and whoever else has to know, what the words are called."""
        assert self._desk.words is not None  # a page has named one of them
        self._spread("words", json.dumps({"kind": "words", **words_fields(self._desk.words)}))
        self.renamed()

    def _controls(self) -> None:
        self._spread("controls", json.dumps({"kind": "controls", **asdict(self._desk.controls)}))


def words_fields(words: Words) -> dict[str, Any]:
    """What a page has to know of the words: their names, the phrases that say each, and how many there can be."""
    return {
        "words": list(words.names),
        "phrases": [list(one.phrases) for one in words.entries],
        "most": len(words),
    }


async def _part(request: web.Request) -> web.Response:
    name, kind = PAGES[request.path]
    body = files(__package__).joinpath(name).read_bytes()
    return web.Response(body=body, content_type=kind, charset="utf-8", headers=SECURITY)


def is_ours(host: str, bound: str = "localhost") -> bool:
    """Whether a request's ``Host`` names this machine.

    Addresses do, and the name that the server was ``bound`` to. Any other name may be DNS rebinding.
    """
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdecimal() else host
    if name.lower() in ("localhost", socket.gethostname().lower(), bound.lower()):
        return True
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
