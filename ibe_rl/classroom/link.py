"""Between the trainer and the process that plays the game: only the newest of each kind is kept, nobody waits."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Client, Connection, Listener
from typing import Any


@dataclass(frozen=True)
class Address:
    """Where the trainer listens, and what the other side has to know to be let in."""

    path: str
    key: bytes


class TrainerEnd:
    """Sends what ``tell`` is given to the other side, once that is there, and hears what that says."""

    def __init__(self) -> None:
        key = os.urandom(32)
        self._listener = Listener(authkey=key)
        self.address = Address(str(self._listener.address), key)
        self._ready = threading.Condition()
        self._newest: dict[str, Any] = {}
        self._said: list[str] = []
        self._closed = False
        threading.Thread(target=self._send, name="link", daemon=True).start()

    def tell(self, kind: str, value: Any) -> None:
        """Let the other side have this; an older one of the kind that has not gone yet is forgotten."""
        with self._ready:
            self._newest[kind] = value
            self._ready.notify_all()

    def wait_for(self, line: str, timeout_s: float) -> bool:
        """Wait until the other side has said something; False if it has not in time."""
        with self._ready:
            return self._ready.wait_for(lambda: line in self._said, timeout_s)

    def close(self) -> None:
        """End; what has not gone stays."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        self._listener.close()

    def _send(self) -> None:
        try:
            connection = self._listener.accept()
            threading.Thread(target=self._receive, args=(connection,), name="link lines", daemon=True).start()
            while True:
                with self._ready:
                    self._ready.wait_for(lambda: self._newest or self._closed)
                    newest, self._newest = self._newest, {}
                    if self._closed and not newest:
                        return
                connection.send(newest)
        except (OSError, EOFError):  # the other side has ended, or nobody ever came
            return

    def _receive(self, connection: Connection[Any, Any]) -> None:
        try:
            while True:
                line = connection.recv()
                with self._ready:
                    self._said.append(str(line))
                    self._ready.notify_all()
        except (OSError, EOFError):
            return


class GameEnd:
    """Gets what the trainer tells, in a thread of its own.

    Args:
        address: of the trainer's end.
        hear: called with each kind and its newest value.
        lost: called when the trainer has gone.
    """

    def __init__(self, address: Address, hear: Mapping[str, Callable[[Any], None]], lost: Callable[[], None]):
        self._connection, self._hear, self._lost = Client(address.path, authkey=address.key), hear, lost
        threading.Thread(target=self._receive, name="link", daemon=True).start()

    def say(self, line: str) -> None:
        """Tell the trainer something."""
        try:
            self._connection.send(line)
        except OSError:  # it has gone, nobody would read it
            return

    def _receive(self) -> None:
        try:
            while True:
                for kind, value in self._connection.recv().items():
                    self._hear[kind](value)
        except (OSError, EOFError):
            self._lost()
