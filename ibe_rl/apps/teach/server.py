"""The small server of the page: loopback by default, one thread, nobody waits for anybody's connection.

Each page has a place for the newest message of each kind. A slow page misses frames; it holds up neither the game nor
the other pages. What pages send is limited in size and number before it is looked at.
"""

from __future__ import annotations

import asyncio
import http
import ipaddress
import json
import logging
import socket
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib.resources import files
from itertools import count
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from ibe_rl.apps.teach.messages import MAX_BYTES, BadMessageError, HandOver, Pause, Sit, Speed, parse
from ibe_rl.apps.teach.session import ACCEPTED, Desk

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
GOODBYE, TOO_MANY, NOT_OURS = 1000, 1008, 1003  # close codes of RFC 6455
PING_S = 5.0
"""A page that does not answer for so long is gone."""
START_S, STOP_S = 10.0, 2.0
UNREAD_BYTES = 1 << 15
"""The system keeps no more for a page that does not read; left to itself it keeps megabytes, half a minute of game."""
SILENT = logging.Logger("pages")
"""What strangers send is not the training's to report."""
SILENT.disabled = True


class Server:
    """Serves the page and carries messages between pages and the desk; use ``close`` in the end.

    Args:
        desk: hears what pages say.
        host: to bind.
        port: to bind.

    Raises:
        OSError: if the port cannot be bound.
    """

    def __init__(self, desk: Desk, host: str, port: int):
        self._desk, self._host, self._port = desk, host, port
        self._waiting: dict[int, dict[str, str]] = {}
        self._news: dict[int, asyncio.Event] = {}
        self._newest: dict[str, str] = {}
        self._numbers = count(1)
        self._loop = asyncio.new_event_loop()
        self._started, self._stop = threading.Event(), asyncio.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="classroom", daemon=True)
        self._thread.start()
        self._started.wait(START_S)
        if self._failure is not None:
            raise self._failure

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
        try:
            self._loop.call_soon_threadsafe(what, *arguments)
        except RuntimeError:  # the loop has ended, nobody is there to be told
            return

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # ends what pages have left running
                runner.run(self._serve())
        except BaseException as error:  # handed to the thread that waits for the start
            self._failure = error
        finally:
            self._started.set()

    async def _serve(self) -> None:
        server = await serve(
            self._attend,
            self._host,
            self._port,
            process_request=self._admit,
            compression=None,
            max_size=MAX_BYTES,
            max_queue=8,
            write_limit=UNREAD_BYTES,
            logger=SILENT,
            ping_interval=PING_S,
            ping_timeout=PING_S,
            open_timeout=PING_S,
            close_timeout=STOP_S,
        )
        self._started.set()
        await self._stop.wait()
        await asyncio.sleep(0.1)  # the last posts are on their way
        server.close()
        with suppress(TimeoutError):  # of a page that does not say goodbye, or never said hello
            await asyncio.wait_for(server.wait_closed(), STOP_S)

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a page; None lets a page of ours open its connection."""
        host = request.headers.get("Host", "")
        if not is_ours(host, self._host):
            return connection.respond(http.HTTPStatus.FORBIDDEN, "this name is not this server's\n")
        path = request.path.partition("?")[0]
        if path == LESSON_PATH:
            return self._refusal(connection, request.headers.get("Origin"), host)
        if path not in PAGES:
            return connection.respond(http.HTTPStatus.NOT_FOUND, "there is no such page\n")
        name, kind = PAGES[path]
        body = files(__package__).joinpath(name).read_bytes()
        headers = {**SECURITY, "Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body))}
        return Response(200, "OK", Headers({**headers, "Connection": "close"}), body)

    def _refusal(self, connection: ServerConnection, origin: str | None, host: str) -> Response | None:
        if origin != f"http://{host}":
            return connection.respond(http.HTTPStatus.FORBIDDEN, "only the page of this server may instruct\n")
        if len(self._waiting) >= MAX_PAGES:
            return connection.respond(http.HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_PAGES} pages are open already\n")
        return None

    async def _attend(self, connection: ServerConnection) -> None:
        """Serve one page until it goes."""
        page = next(self._numbers)
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD_BYTES)
        self._waiting[page], self._news[page] = dict(self._newest), asyncio.Event()
        self._desk.join(page)
        self._seats()
        self._controls()
        sender, ending = asyncio.create_task(self._send(connection, page)), (GOODBYE, "")
        try:
            ending = await self._hear(connection, page)
        except ConnectionClosed:
            pass
        finally:  # before the close, which waits for the page's goodbye: the chair is free at once
            sender.cancel()
            del self._waiting[page], self._news[page]
            self._desk.leave(page)
            self._seats()
            self._controls()
        await connection.close(*ending)

    async def _hear(self, connection: ServerConnection, page: int) -> tuple[int, str]:
        """Take in what a page says, until it goes or has to; returns why."""
        allowance, at, bad = float(MAX_A_SECOND), time.monotonic(), 0
        async for text in connection:
            now = time.monotonic()
            allowance, at = min(MAX_A_SECOND, allowance + (now - at) * MAX_A_SECOND) - 1, now
            if allowance < 0:
                return TOO_MANY, "too many messages"
            try:
                self._take_in(page, text)
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

    async def _send(self, connection: ServerConnection, page: int) -> None:
        news, waiting = self._news[page], self._waiting[page]
        with suppress(ConnectionClosed):
            while True:
                await news.wait()
                news.clear()
                while waiting:
                    await connection.send(waiting.pop(next(iter(waiting))))

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
        now = self._desk.controls
        self._spread(
            "controls",
            json.dumps({"kind": "controls", "paused": now.paused, "speed": now.speed, "oracle": now.oracle}),
        )


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
