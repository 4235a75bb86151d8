"""A study is served until it is told to end, and what it confirmed survives a kill."""

from __future__ import annotations

import json
import signal
import socket
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import pytest
from own_study import write_study
from served import served

from ibe_rl.apps.study.recruiters import CODES_FILE
from ibe_rl.apps.study.serving import serve
from ibe_rl.runtime.ports import free_port
from ibe_rl.types import ConfigError


def get(address: str, body: dict[str, Any] | None = None) -> dict[str, Any]:
    sent = None if body is None else json.dumps(body).encode()
    with urlopen(Request(address, sent), timeout=30) as reply:  # noqa: S310 - of the server below
        return dict(json.load(reply))


@pytest.mark.slow
def test_what_was_confirmed_survives_a_kill_and_it_ends_in_order(tmp_path: Path) -> None:
    with served(write_study(tmp_path / "study")) as server:
        begun = get(f"{server.address}/begin", {"code": "k1"})
        answer = {"page": "consent", "attempt": 1, "value": {"agrees": True}, "took_ms": 1, "hidden_ms": 0}
        get(f"{server.address}{begun['address']}/answer", answer)
        admin = f"http://127.0.0.1:{server.admin_port}"
        assert get(f"{admin}/recruiting", {"recruiting": False})["recruiting"] is False
        assert server.end(signal.SIGKILL) == -signal.SIGKILL
        assert [one.page for one in server.kept()[1]] == ["consent"]
        assert server.start() == [f"admin page: {admin}/", f"people take part here: {server.address}/"]
        assert get(f"{server.address}{begun['address']}/now")["page"] == "demographics"
        assert get(f"{admin}/state")["recruiting"] is False
        assert server.end(signal.SIGTERM) == 0
        server.start()
        assert server.end(signal.SIGINT) == 0


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_study(tmp_path / "study")


def test_a_port_that_is_taken_is_named(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=f"^port={port}: taken"):
            serve(folder, port=port)
        free = free_port(0, 0)
        with pytest.raises(ConfigError, match=f"^admin_port={port}: taken"):
            serve(folder, port=free, admin_port=port)
        with pytest.raises(ConfigError, match=f"^admin_port={free}: taken"):
            serve(folder, port=free, admin_port=free)


def test_codes_are_for_a_laboratory(tmp_path: Path) -> None:
    codes = {"finished": "1", "screened_out": "2", "no_consent": "3"}
    folder = write_study(tmp_path / "study", recruiter="prolific", completion_codes=codes)
    with pytest.raises(ConfigError, match=r"^codes=9: allowed with recruiter=prolific is 0"):
        serve(folder, codes=9)
    assert not (folder / CODES_FILE).exists()
