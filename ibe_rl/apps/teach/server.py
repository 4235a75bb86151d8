"""The small server of the page: loopback by default, one thread, nobody waits for anybody's connection.

Each page has a place for the newest message of each kind. A slow page misses frames; it holds up neither the game nor
the other pages. What pages send is limited in size and number before it is looked at.
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

from ibe_rl.apps.teach.messages import MAX_BYTES, BadMessageError, HandOver, Pause, Sit, Speed, parse
from ibe_rl.apps.teach.session import ACCEPTED, TeachingSession

LESSON_PATH = "/lesson"
PAGES = {
    "/": ("page.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/drawing.js": ("drawing.js", "text/javascript"),
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
"""Messages of one page; a key held down sends 2."""
MAX_BAD = 10
GOODBYE, LEAVING, NOT_OURS, TOO_MANY = 1000, 1001, 1003, 1008  # close codes of RFC 6455
PING_S = 6.0
"""A page that has been quiet for so long is asked whether it is there; it is gone after half as long again."""
SERVER_START_S, STOP_S, CUT_S = 10.0, 2.0, 0.1
OPEN_S = 5.0
"""A connection that has asked for nothing for so long is closed."""
UNREAD_BYTES = 1 << 15
"""The system keeps no more for a page that does not read; left to itself it keeps megabytes, half a minute of game."""


class Server:
    """Serves the page and carries messages between pages and the desk; use ``close`` in the end.

    Args:
        desk: hears what pages say.
        host: to bind.
        port: to bind.

    Raises:
        OSError: if the port cannot be bound.
    """

    def __init__(self, desk: TeachingSession, host: str, port: int):
        self._desk, self._host, self._port = desk, host, port
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
        """Show pages something; only the newest of each kind waits for a page that is slow. Waits for nothing.

        What is no finite number cannot be sent; such a picture is left out.
        """
        with suppress(ValueError):
            text = json.dumps({"kind": kind, **fields}, separators=(",", ":"), allow_nan=False)
            self._call(self._spread, kind, text)

    def close(self) -> None:
        """Let what has been posted arrive, then end."""
        self._call(self._stop.set)
        self._thread.join(2 * STOP_S)

    def _call(self, what: Callable[..., Any], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop has ended, nobody is there to be told
            self._loop.call_soon_threadsafe(what, *arguments)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # ends what pages have left running
            try:
                runner.run(self._serve())
            except OSError as error:  # handed to the thread that waits for the start
                self._started.set_exception(error)

    async def _serve(self) -> None:
        logging.getLogger("aiohttp").setLevel(logging.CRITICAL + 1)  # what strangers send is not ours to report
        app = web.Application(middlewares=[self._admit])
        app.add_routes([web.get(LESSON_PATH, self._attend), *(web.get(path, _part) for path in PAGES)])
        runner = web.AppRunner(app, access_log=None, keepalive_timeout=OPEN_S, shutdown_timeout=CUT_S)
        await runner.setup()
        await web.TCPSite(runner, self._host, self._port).start()
        self._started.set_result(None)
        await self._stop.wait()
        for news in self._news.values():
            news.set()
        if self._attending:  # now, as the cleanup hears no goodbye
            await asyncio.wait(self._attending, timeout=STOP_S)
        await runner.cleanup()

    @web.middleware
    async def _admit(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if not is_ours(request.headers.get("Host", ""), self._host):
            raise web.HTTPForbidden(text="this name is not this server's\n")
        return await handler(request)

    async def _attend(self, request: web.Request) -> web.WebSocketResponse:
        """Let a page of ours open its connection and serve it until it goes."""
        if request.headers.get("Origin") != f"http://{request.headers['Host']}":
            raise web.HTTPForbidden(text="only the page of this server may instruct\n")
        if len(self._waiting) >= MAX_PAGES:
            raise web.HTTPServiceUnavailable(text=f"{MAX_PAGES} pages are open already\n")
        connection = web.WebSocketResponse(heartbeat=PING_S, max_msg_size=MAX_BYTES + 1, compress=False, writer_limit=0)
        await connection.prepare(request)
        transport = request.transport
        assert transport is not None  # without one it could not be prepared
        transport.set_write_buffer_limits(UNREAD_BYTES)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD_BYTES)
        self._attending.add(request.task)
        try:
            code, why = await self._converse(connection)
            async with asyncio.timeout(STOP_S):
                await connection.close(code=code, message=why.encode())
        except TimeoutError:  # it does not say goodbye
            pass
        finally:
            transport.abort()
            self._attending.discard(request.task)
        return connection

    async def _converse(self, connection: web.WebSocketResponse) -> tuple[int, str]:
        """Show a page the game and hear what it says; returns why it has to go."""
        page = next(self._numbers)
        self._waiting[page], self._news[page] = dict(self._newest), asyncio.Event()
        self._desk.join(page)
        self._seats()
        self._controls()
        talks = [asyncio.create_task(talk(connection, page)) for talk in (self._hear, self._send)]
        try:
            done, _ = await asyncio.wait(talks, return_when=asyncio.FIRST_COMPLETED)
            return done.pop().result()
        finally:  # before the close, which waits for the page's goodbye: the chair is free at once
            for talk in talks:
                talk.cancel()
            del self._waiting[page], self._news[page]
            self._desk.leave(page)
            self._seats()
            self._controls()
            await asyncio.wait(talks)  # before the page's goodbye is read

    async def _hear(self, connection: web.WebSocketResponse, page: int) -> tuple[int, str]:
        """Take in what a page says, until it goes or has to; returns why."""
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

    async def _send(self, connection: web.WebSocketResponse, page: int) -> tuple[int, str]:
        """Send a page what waits for it, until the server ends."""
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

    def _controls(self) -> None:
        self._spread("controls", json.dumps({"kind": "controls", **asdict(self._desk.controls)}))


async def _part(request: web.Request) -> web.Response:
    name, kind = PAGES[request.path]
    body = files(__package__).joinpath(name).read_bytes()
    return web.Response(body=body, content_type=kind, charset="utf-8", headers=SECURITY)


def is_ours(host: str, bound: str = "localhost") -> bool:
    """Whether a request's ``Host`` can be meant for this machine.

    A name that somebody else's server gave out and now points here (DNS rebinding) is none; addresses are, and so is
    the name that the server was ``bound`` to.
    """
    name = host.rpartition(":")[0] if host.rpartition(":")[2].isdecimal() else host
    if name.lower() in ("localhost", socket.gethostname().lower(), bound.lower()):
        return True
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
