"""Pages without a browser: what one sends and sees, against the real server."""

from __future__ import annotations

import json
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPConnection, HTTPResponse
from typing import Any

from view_data import eventually
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from ibe_rl.apps.teach.phrase_groups import Nearest
from ibe_rl.apps.teach.server import Server
from ibe_rl.apps.teach.session import TeachingSession
from ibe_rl.runtime.ports import HOST, free_port
from ibe_rl.task.words import Words

VALUES = (-1.0, 0.0, 1.0)


class Room:
    """A desk with the server before it."""

    def __init__(self, words: Words | None = None, nearest: Nearest | None = None) -> None:
        self.desk = TeachingSession(VALUES, hold_steps=0, speed=1.0, words=words, nearest=nearest)
        self.port = free_port(0, 0)
        self.server = Server(self.desk, HOST, self.port)

    def page(self, **settings: Any) -> Client:
        return Client(self.port, **settings)

    def seated(self) -> Client:
        """The page that instructs."""
        page = self.page()
        assert page.until("seat")["instructs"]
        return page

    def raw(self, sent: bytes = b"") -> socket.socket:
        """A connection that need not know any protocol."""
        plain = socket.create_connection((HOST, self.port), timeout=30)
        plain.sendall(sent)
        return plain

    def get(self, path: str, **headers: str) -> tuple[HTTPResponse, bytes]:
        connection = HTTPConnection(HOST, self.port, timeout=30)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer, body


@contextmanager
def open_room(words: Words | None = None, nearest: Nearest | None = None) -> Iterator[Room]:
    room = Room(words, nearest)
    try:
        yield room
    finally:
        room.server.close()


class Client:
    """A page as the server knows it.

    Args:
        port: of the server.
        settings: of the websocket.
    """

    def __init__(self, port: int, **settings: Any):
        origin = settings.pop("origin", f"http://{HOST}:{port}")
        settings = {"compression": None, "ping_interval": None, "max_queue": None, "close_timeout": 0.5, **settings}
        self._opened = ExitStack()
        self.socket: ClientConnection = self._opened.enter_context(
            connect(f"ws://{HOST}:{port}/lesson", origin=origin, **settings)
        )

    def say(self, kind: str, **fields: Any) -> None:
        self.socket.send(json.dumps({"kind": kind, **fields}))

    def next(self, timeout_s: float = 60.0) -> dict[str, Any]:
        message: dict[str, Any] = json.loads(self.socket.recv(timeout=timeout_s))
        return message

    def until(self, kind: str, holds: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """Read on to a message of the ``kind`` of which something ``holds``."""
        end = time.monotonic() + 60
        while time.monotonic() < end:
            message = self.next()
            if message["kind"] == kind and holds(message):
                return message
        raise AssertionError(f"no such {kind}")

    def closing(self) -> tuple[int, str]:
        """Read to the end; its code and reason."""
        with suppress(ConnectionClosed):
            while True:
                self.socket.recv(timeout=30)
        return self.socket.close_code or 0, self.socket.close_reason or ""

    def close(self) -> None:
        self._opened.close()

    def kill(self, reset: bool = False) -> None:
        """Go without a word, as a process does that is killed; with a ``reset`` if it has left something unread."""
        plain = self.socket.socket
        with suppress(OSError):  # the server may have ended the connection before
            if reset:
                plain.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            plain.shutdown(socket.SHUT_RD if reset else socket.SHUT_RDWR)
        plain.close()


__all__ = ["VALUES", "Client", "Room", "eventually", "open_room"]
