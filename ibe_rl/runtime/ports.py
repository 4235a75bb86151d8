"""Finds and checks free ports of this machine."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from ibe_rl.runtime.operating_system import accepts, can_listen
from ibe_rl.types import ConfigError

HOST = "127.0.0.1"
"""Default address that servers bind."""


def asked_port(key: str, port: int | None, other: int | None = None, host: str = HOST) -> int | None:
    """Check a port given by number; None passes.

    Args:
        key: of the setting.
        port: its value.
        other: a port that is already reserved.
        host: to bind.

    Raises:
        ConfigError: if there is no such port or it is taken.
    """
    if port is None:
        return None
    allowed = "allowed is a free port from 1 to 65535, or null to choose one"
    if not 1 <= port <= 65535:
        raise ConfigError(f"{key}={port}: no such port, {allowed}")
    if port == other or not is_free(port, host):
        raise ConfigError(f"{key}={port}: taken, {allowed}")
    return port


def free_port(default: int, other: int | None = None, host: str = HOST) -> int:
    """The ``default`` if it is free and not ``other``, else any free port."""
    if default != other and is_free(default, host):
        return default
    with socket.create_server((host, 0), family=_family(host)) as probe:
        found = int(probe.getsockname()[1])
        return found if found != other else free_port(default, other, host)  # ``found`` is held meanwhile


def is_free(port: int, host: str = HOST) -> bool:
    """True if a server could listen on this port."""
    return can_listen(port, host, _family(host))


@contextmanager
def reserved(*ports: int, host: str = HOST) -> Iterator[list[int]]:
    """Reserve ports for a server that is about to be started, among the programs that reserve theirs as well.

    Two of them could find the same port free before either listens. So each holds the UDP port of the same number
    meanwhile, which does not hinder the server.

    Yields:
        those that are not free, or that another program has reserved.
    """
    with ExitStack() as held:
        yield [port for port in ports if not (_reserve(port, host, held) and is_free(port, host))]


def _reserve(port: int, host: str, held: ExitStack) -> bool:
    reserving = held.enter_context(socket.socket(_family(host), socket.SOCK_DGRAM))
    try:
        reserving.bind((host, port))
    except OSError:
        return False
    return True


def is_served(port: int, host: str = HOST) -> bool:
    """True if a server answers on this port."""
    return accepts(port, host, _family(host))


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET
