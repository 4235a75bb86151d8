"""Which ports are free, which may be asked for, and on which of this machine's addresses."""

import socket
from collections.abc import Iterator
from typing import Any

import pytest
from view_data import free_ports, needed

from ibe_rl.runtime import ports
from ibe_rl.runtime.ports import HOST, asked_port, free_port, is_free, reserved
from ibe_rl.types import ConfigError

OTHER_HOST = "127.0.0.2"
"""On Linux all of 127.0.0.0/8 is this machine."""


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.create_server((HOST, 0)) as server:
        yield server.getsockname()[1]


def port() -> int:
    return free_ports().web


def test_a_port_is_free_until_somebody_listens(taken: int) -> None:
    assert not is_free(taken)
    free = port()
    assert is_free(free)
    assert is_free(free)  # looking does not take it
    with socket.create_server((HOST, free)):
        assert not is_free(free)
    assert is_free(free)


def test_a_port_is_free_as_soon_as_its_server_has_gone() -> None:
    """Though connections that the server closed first linger there for a minute."""
    with socket.create_server((HOST, 0)) as server:
        here = server.getsockname()[1]
        with socket.create_connection((HOST, here)) as client:
            server.accept()[0].close()
            assert client.recv(1) == b""
    assert is_free(here)


def test_each_address_has_its_own_ports(taken: int) -> None:
    assert is_free(taken, OTHER_HOST)
    assert asked_port("key", taken, host=OTHER_HOST) == taken
    assert free_port(taken, host=OTHER_HOST) == taken


def test_addresses_with_colons_have_ports_too() -> None:
    needed(socket.has_ipv6 and _has("::1"), "IPv6")
    with socket.create_server(("::1", 0), family=socket.AF_INET6) as server:
        here = server.getsockname()[1]
        assert not is_free(here, "::1")
        assert free_port(here, host="::1") not in (here, 0)


def _has(host: str) -> bool:
    try:
        socket.create_server((host, 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


def test_nothing_asked_for_is_nothing() -> None:
    assert asked_port("key", None) is None


def test_a_free_port_can_be_asked_for() -> None:
    free = port()
    assert asked_port("key", free) == free
    assert asked_port("key", free, other=free + 1) == free


@pytest.mark.parametrize("number", [0, -1, 65536])
def test_what_is_no_port_is_refused(number: int) -> None:
    expected = rf"^viewer\.web_port={number}: no such port, allowed is .* 1 to 65535, or null to choose one$"
    with pytest.raises(ConfigError, match=expected):
        asked_port("viewer.web_port", number)


def test_a_port_that_is_taken_or_spoken_for_is_refused(taken: int) -> None:
    expected = "taken, allowed is a free port from 1 to 65535, or null to choose one"
    with pytest.raises(ConfigError, match=rf"^some\.key={taken}: {expected}$"):
        asked_port("some.key", taken)
    free = port()
    with pytest.raises(ConfigError, match=rf"^some\.key={free}: {expected}$"):
        asked_port("some.key", free, other=free)


def test_the_default_is_chosen_where_it_is_free(taken: int) -> None:
    free = port()
    assert free_port(free) == free_port(free, other=taken) == free
    for chosen in (free_port(taken), free_port(free, other=free)):
        assert chosen not in (taken, free)
        assert is_free(chosen)


def test_what_is_chosen_is_never_the_one_that_is_spoken_for(taken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Even if that is the very port which the system hands out."""
    other, make, asked = port(), socket.create_server, []

    def handed_out(address: tuple[str, int], **kwargs: Any) -> socket.socket:
        asked.append(address)
        return make((address[0], other if len(asked) == 1 else 0), **kwargs)

    monkeypatch.setattr(ports.socket, "create_server", handed_out)
    assert free_port(taken, other=other) not in (taken, other)
    assert asked == [(HOST, 0)] * 2


def test_an_address_of_another_machine_has_no_ports() -> None:
    with pytest.raises(OSError, match="assign"):
        free_port(port(), host="192.0.2.1")  # of the addresses that are kept for examples


def test_what_one_program_has_reserved_another_finds_taken(taken: int) -> None:
    """Before anything listens there; and a server can be started all the same."""
    free = port()
    with reserved(free) as none:
        assert none == []
        with reserved(taken, free) as both:
            assert both == [taken, free]
        with socket.create_server((HOST, free)):
            assert not is_free(free)
    with reserved(free) as none:
        assert none == []
