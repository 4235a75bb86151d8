"""Where a live view is: the ports of rerun's server, and what a person is told of them."""

from __future__ import annotations

import getpass
import socket
from dataclasses import dataclass
from urllib.parse import quote

from ibe_rl.runtime.ports import HOST, asked_port, free_port

GRPC_PORT, WEB_PORT = 9876, 9090


@dataclass(frozen=True)
class Ports:
    """The two ports of the live view: ``grpc`` carries the data, ``web`` the page.

    ``asked`` holds what was asked for by its number, in the same order; None: any free port would do.
    """

    grpc: int
    web: int
    asked: tuple[int | None, int | None] = (None, None)

    def moved(self) -> list[tuple[int, int]]:
        """The defaults that were taken, and what is used instead."""
        pairs = ((GRPC_PORT, self.grpc), (WEB_PORT, self.web))
        return [pair for pair, asked in zip(pairs, self.asked, strict=True) if asked is None and pair[0] != pair[1]]


def choose_ports(grpc_port: int | None, web_port: int | None) -> Ports:
    """Decide on both ports.

    Args:
        grpc_port: None for 9876, or a free one if that is taken.
        web_port: None for 9090, or a free one if that is taken.

    Raises:
        ConfigError: if a port asked for by its number is taken or none at all, or both are the same.
    """
    grpc = asked_port("viewer.grpc_port", grpc_port)
    web = asked_port("viewer.web_port", web_port, other=grpc)
    chosen_grpc = grpc or free_port(GRPC_PORT, other=web)
    chosen_web = web or free_port(WEB_PORT, other=chosen_grpc)
    return Ports(chosen_grpc, chosen_web, (grpc, web))


def invitation(ports: Ports) -> str:
    """What to tell the person who wants to look: the address, how to reach it from elsewhere, and ports that moved."""
    lines = [f"live view: {page(ports)}", f"  from another machine, forward it first: {port_forward(ports)}"]
    lines += [f"  port {default} is taken, so this is on {port}" for default, port in ports.moved()]
    return "\n".join(lines)


def page(ports: Ports) -> str:
    """The address to open in a browser on this machine."""
    data = quote(f"rerun+http://{HOST}:{ports.grpc}/proxy", safe="")
    return f"http://{HOST}:{ports.web}/?url={data}&hide_welcome_screen=1&theme=dark"


def port_forward(ports: Ports) -> str:
    """The command that makes ``page`` work on another machine; both numbers must stay the same there."""
    forwards = " ".join(f"-L {port}:{HOST}:{port}" for port in (ports.web, ports.grpc))
    return f"ssh {forwards} {_user()}@{socket.gethostname()}"


def _user() -> str:
    """The name to log in with; where this user has none (as in a container), what to put in its place."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # OSError from Python 3.13 on
        return "USER"
