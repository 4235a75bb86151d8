"""Link from the trainer to the process that steps the environments: keeps only the newest message of each kind."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener
from typing import Any


@dataclass(frozen=True)
class Address:
    """Where the trainer listens, and the key that the other side needs."""

    path: str
    key: bytes


class TrainerEnd:
    """The trainer's end: sends messages once the other side has connected, and receives its lines.

    Args:
        hear: called by kind with what the other side says beside lines, in a thread.
    """

    def __init__(self, hear: Mapping[str, Callable[[Any], None]] | None = None) -> None:
        self._hear = hear or {}
        key = os.urandom(32)
        self._listener = Listener(authkey=key)
        self.address = Address(str(self._listener.address), key)
        self._ready = threading.Condition()
        self._newest: dict[str, Any] = {}
        self._said: list[str] = []
        self._connected = self._closed = False
        threading.Thread(target=self._send, name="link", daemon=True).start()

    def tell(self, kind: str, value: Any) -> None:
        """Queue a message; it replaces an unsent one of the same kind."""
        with self._ready:
            self._newest[kind] = value
            self._ready.notify_all()

    def wait_for(self, line: str, timeout_s: float) -> bool:
        """Wait until the other side has sent ``line``; False on timeout."""
        with self._ready:
            return self._ready.wait_for(lambda: line in self._said, timeout_s)

    def close(self) -> None:
        """Close; unsent messages are dropped."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        if not self._connected:
            with suppress(OSError):  # wakes a blocked accept; closing alone does not
                Client(self.address.path).close()
        self._listener.close()

    def _accept(self) -> Connection[Any, Any]:
        """Wait for the other side to connect.

        Raises:
            EOFError: if this end has been closed.
        """
        while not self._closed:
            with suppress(AuthenticationError, EOFError, ConnectionError):  # not our process: wait for the next
                return self._listener.accept()
        raise EOFError

    def _send(self) -> None:
        try:
            connection = self._accept()
            self._connected = True
            threading.Thread(target=self._receive, args=(connection,), name="link lines", daemon=True).start()
            while True:
                with self._ready:
                    self._ready.wait_for(lambda: self._newest or self._closed)
                    newest, self._newest = self._newest, {}
                connection.send(newest)  # an empty message says goodbye
                if not newest:
                    return
        except (OSError, EOFError):  # the other side has ended, or never connected
            return

    def _receive(self, connection: Connection[Any, Any]) -> None:
        try:
            while True:
                line = connection.recv()
                if isinstance(line, tuple):
                    self._hear[line[0]](line[1])
                    continue
                with self._ready:
                    self._said.append(str(line))
                    self._ready.notify_all()
        except (OSError, EOFError):
            return


class GameEnd:
    """The environment's end: receives the trainer's messages in a thread of its own.

    Args:
        address: where the trainer listens.
        hear: called by kind with its newest value.
        lost: called when the trainer has gone.
    """

    def __init__(self, address: Address, hear: Mapping[str, Callable[[Any], None]], lost: Callable[[], None]):
        self._connection, self._hear, self._lost = Client(address.path, authkey=address.key), hear, lost
        threading.Thread(target=self._receive, name="link", daemon=True).start()

    def say(self, line: str | tuple[str, Any]) -> None:
        """Send the trainer a line, or a kind and its value."""
        try:
            self._connection.send(line)
        except OSError:  # the trainer has gone
            return

    def _receive(self) -> None:
        try:
            while news := self._connection.recv():
                for kind, value in news.items():
                    self._hear[kind](value)
        except (OSError, EOFError):
            return
        finally:  # on any error too: without the trainer the environment must not wait
            self._connection.close()
            self._lost()
