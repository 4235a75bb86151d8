"""The address of a live view: which ports are chosen, and what a person is told of them."""

import getpass
import socket
from unittest.mock import Mock
from urllib.parse import parse_qs, urlsplit

import pytest
from view_data import free_ports

from ibe_rl.runtime.ports import is_free
from ibe_rl.types import ConfigError
from ibe_rl.view import address as module
from ibe_rl.view.address import Ports, choose_ports, port_forward


def test_defaults_are_taken_where_they_are_free(monkeypatch: pytest.MonkeyPatch) -> None:
    free = free_ports()
    monkeypatch.setattr(module, "GRPC_PORT", free.grpc)
    monkeypatch.setattr(module, "WEB_PORT", free.web)
    assert choose_ports(None, None) == free
    assert "taken" not in module.invitation(free)


def test_a_taken_default_moves(monkeypatch: pytest.MonkeyPatch, taken: int) -> None:
    monkeypatch.setattr(module, "GRPC_PORT", taken)
    monkeypatch.setattr(module, "WEB_PORT", taken)
    ports = choose_ports(None, None)
    assert taken not in (ports.grpc, ports.web)
    assert ports.grpc != ports.web
    assert is_free(ports.grpc)
    assert is_free(ports.web)
    assert f"port {taken} is taken, so this is on {ports.web}" in module.invitation(ports)


def test_a_default_gives_way_to_the_port_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    free = free_ports()
    monkeypatch.setattr(module, "GRPC_PORT", free.web)
    ports = choose_ports(None, free.web)
    assert ports.web == free.web
    assert ports.grpc != free.web


def test_a_port_asked_for_and_taken_is_refused(taken: int) -> None:
    with pytest.raises(ConfigError, match=f"viewer.grpc_port={taken}: taken, allowed is a free port"):
        choose_ports(taken, None)
    with pytest.raises(ConfigError, match=f"viewer.web_port={taken}: taken"):
        choose_ports(None, taken)


def test_one_port_cannot_be_both() -> None:
    port = free_ports().web
    with pytest.raises(ConfigError, match=f"viewer.web_port={port}: taken"):
        choose_ports(port, port)


def test_the_address_names_the_data_percent_encoded() -> None:
    address = urlsplit(module.page(Ports(grpc=1234, web=5678)))
    assert address.netloc == "127.0.0.1:5678"
    assert "+" not in address.query
    assert parse_qs(address.query) == {
        "url": ["rerun+http://127.0.0.1:1234/proxy"],
        "hide_welcome_screen": ["1"],
        "theme": ["dark"],
    }


def test_the_forward_keeps_both_numbers() -> None:
    command = module.port_forward(Ports(grpc=1234, web=5678))
    assert command.startswith("ssh -L 5678:127.0.0.1:5678 -L 1234:127.0.0.1:1234 ")
    assert command.endswith("@" + socket.gethostname())


@pytest.mark.parametrize("error", [KeyError("getpwuid(): uid not found: 12345"), OSError("No username set")])
def test_a_user_without_a_name_has_a_live_view_too(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    monkeypatch.setattr(getpass, "getuser", Mock(side_effect=error))
    assert "-L 1:127.0.0.1:1 -L 2:127.0.0.1:2 USER@" in port_forward(Ports(2, 1))


def test_what_was_asked_for_is_kept_and_has_not_moved() -> None:
    free = free_ports()
    ports = choose_ports(free.grpc, free.web)
    assert ports.asked == (free.grpc, free.web)
    assert ports.moved() == []
