"""The relay: it serves a growing file, ends with its trainer, and never makes it wait."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from urllib.request import urlopen

import pytest
from processes import gone, server_of
from rerun.chunk import RrdReader
from view_data import TASK, eventually, free_ports

from ibe_rl.runtime.ports import is_free
from ibe_rl.view import relay as module
from ibe_rl.view.address import Ports, invitation, page
from ibe_rl.view.recorder import Recorder
from ibe_rl.view.relay import Relay, _main, rerun_binary


def frames_in(path: Path) -> list[int]:
    """Frames of the return's curve in a file, as far as it is written."""
    try:
        batches = [c.to_record_batch() for c in RrdReader(str(path)).stream() if c.entity_path == "/curves/train/r"]
    except (RuntimeError, ValueError, OSError):  # cut in the middle of a message
        return []
    return sorted(frame for batch in batches for frame in batch.to_pydict()["frames"])


def test_without_the_viewer_there_is_no_relay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(RuntimeError, match="rerun viewer is not installed: pip install rerun-sdk"):
        Relay(tmp_path / "recording.rrd", free_ports())


def test_a_process_that_cannot_start_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="live view cannot be started"):
        Relay(tmp_path / "no such folder" / "recording.rrd", free_ports())


def test_the_command_names_the_one_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        _main(["--help"])
    assert "python -m ibe_rl.viewer RUN" in capsys.readouterr().out


def test_a_file_that_is_being_written_arrives_whole(tmp_path: Path) -> None:
    """The relay is there before the file; the listener comes late and gets all the same rows."""
    path, heard, ports = tmp_path / "recording.rrd", tmp_path / "heard.rrd", free_ports()
    with Relay(path, ports) as relay:
        recorder = Recorder(path, TASK, "run")
        recorder.batch(1, {"train/r": 1.0})
        recorder.flush()
        assert eventually(lambda: not is_free(ports.grpc))
        url = f"rerun+http://127.0.0.1:{ports.grpc}/proxy"
        listen = [rerun_binary(), url, "--save", heard, "--port", str(free_ports().grpc)]
        with subprocess.Popen(listen, stderr=subprocess.DEVNULL) as listener:
            try:
                assert eventually(lambda: heard.exists() and frames_in(heard) == [1])
                for frame in range(2, 30):
                    recorder.batch(frame, {"train/r": 1.0})
                    recorder.flush()
                assert eventually(lambda: frames_in(heard) == list(range(1, 30)))
            finally:
                listener.terminate()
        with urlopen(f"http://127.0.0.1:{ports.web}/") as answer:
            assert answer.status == 200
        assert relay.alive()
        recorder.close()
    assert (tmp_path / module.LOG).read_text() == f"{module.SERVES}\n"  # nothing to complain of
    assert not relay.alive()
    assert is_free(ports.grpc)


def test_a_hanging_viewer_makes_nobody_wait(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    recorder, relay = Recorder(path, TASK, "run"), Relay(path, free_ports())
    server = server_of(relay._process.pid)
    os.kill(server, signal.SIGSTOP)
    start = time.perf_counter()
    for frame in range(40):
        recorder.batch(frame, {f"train/{i}": float(frame) for i in range(20)})
        recorder.flush()
    recorder.close()
    assert time.perf_counter() - start < 30
    assert relay.alive()
    assert path.stat().st_size > 5 * 65_536  # far more than a pipe holds
    relay.close()
    assert not relay.alive()
    assert eventually(lambda: gone(server))
    relay.close()


def test_a_viewer_that_dies_ends_the_relay_only(tmp_path: Path) -> None:
    recorder, relay = Recorder(tmp_path / "recording.rrd", TASK, "run"), Relay(tmp_path / "recording.rrd", free_ports())
    os.kill(server_of(relay._process.pid), signal.SIGKILL)
    assert eventually(lambda: not relay.alive())
    recorder.batch(1, {"train/r": 1.0})
    recorder.close()
    relay.close()


def test_a_killed_relay_takes_the_viewer_along(tmp_path: Path) -> None:
    Recorder(tmp_path / "recording.rrd", TASK, "run").close()
    with Relay(tmp_path / "recording.rrd", free_ports()) as relay:
        server = server_of(relay._process.pid)
        os.kill(relay._process.pid, signal.SIGKILL)
        assert eventually(lambda: gone(server))


@pytest.mark.parametrize(
    ("number", "why"),
    [(signal.SIGKILL, "its process has ended (SIGKILL)"), (signal.SIGSTOP, "its process has been stopped")],
)
def test_a_relay_that_is_gone_is_said_once(tmp_path: Path, number: int, why: str) -> None:
    with Relay(tmp_path / "recording.rrd", free_ports()) as relay:
        assert relay.news() == []
        os.kill(relay._process.pid, number)
        found: list[str] = []
        assert eventually(lambda: found.extend(relay.news()) or found)
        assert why in found[0]
        assert "the recording is written all the same" in found[0]
        assert f"-m ibe_rl.viewer {tmp_path}" in found[0]
        assert relay.news() == []
        relay._process.kill()  # a stopped one would be waited for


def test_a_relay_without_its_log_is_missed_all_the_same(tmp_path: Path) -> None:
    with Relay(tmp_path / "recording.rrd", free_ports()) as relay:
        (tmp_path / "viewer.log").unlink()
        relay._process.kill()
        assert eventually(lambda: not relay.alive())
        assert "its process has ended (SIGKILL)" in relay.news()[0]


def test_a_port_taken_between_choosing_and_serving_is_said(
    tmp_path: Path, taken: int, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "recording.rrd").touch()
    ports = Ports(free_ports().grpc, taken)
    assert module.relay(tmp_path / "recording.rrd", ports, module._Stop(None)) == module.PORT_TAKEN
    assert capsys.readouterr().err == f"relay: port {taken} was free, but is taken now\n"


def recorded(path: Path) -> None:
    """Write a recording: its server answers once it has got something."""
    with closing(Recorder(path, TASK, "run")) as recorder:
        recorder.batch(1, {"train/r": 1.0})


def test_where_any_port_would_do_another_one_is_taken(tmp_path: Path, taken: int) -> None:
    """As when two runs are started at once: whoever comes second serves elsewhere, and names no page of the first."""
    recorded(tmp_path / "recording.rrd")
    free = free_ports().grpc
    with Relay(tmp_path / "recording.rrd", Ports(free, taken, asked=(free, None))) as relay:
        [news] = relay.wait()
        served = relay._ports
        assert served.grpc == free
        assert served.web != taken
        assert news.splitlines()[0] == f"live view: {page(served)}"
        assert urlopen(f"http://127.0.0.1:{served.web}/").status == 200
        assert relay.news() == []


def test_a_port_that_was_asked_for_is_not_changed(tmp_path: Path, taken: int) -> None:
    (tmp_path / "recording.rrd").touch()
    with Relay(tmp_path / "recording.rrd", Ports(free_ports().grpc, taken, asked=(None, taken))) as relay:
        [news] = relay.wait()
        assert f"the live view has ended: port {taken} was free, but is taken now" in news
        assert not relay.alive()


def test_the_server_of_another_program_is_not_announced(tmp_path: Path) -> None:
    """It answers on both ports before there is a recording to serve."""
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
        ports = Ports(one.getsockname()[1], other.getsockname()[1])
        with Relay(tmp_path / "recording.rrd", ports) as relay:
            assert relay.alive()
            assert relay.news() == []
            recorded(tmp_path / "recording.rrd")
            [news] = relay.wait()
            assert page(ports) not in news
            assert f"live view: {page(relay._ports)}" in news


class Slow:
    """A server that takes ten bytes at a time and dies after so many."""

    def __init__(self, dies_after: int) -> None:
        self.taken, self.offered, self._dies_after = b"", 0, dies_after

    def alive(self) -> bool:
        return len(self.taken) < self._dies_after

    def hangs(self) -> bool:
        return len(self.taken) >= 50

    def feed(self, data: bytes) -> bytes:
        self.taken, self.offered = self.taken + data[:10], max(self.offered, len(data))
        return data[10:]


def test_a_slow_server_gets_all_in_bounded_pieces_and_a_hang_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "CHUNK_BYTES", 64)
    data = bytes(range(250)) * 4
    (tmp_path / "recording.rrd").write_bytes(data)
    server = Slow(len(data))
    module.follow(tmp_path / "recording.rrd", server, module._Stop(None))
    assert server.taken == data
    assert server.offered == 64
    assert capsys.readouterr().err == "relay: the viewer's server hangs, it has taken nothing for 8 s\n"


TRAINER = """
import sys, time
from pathlib import Path
from unittest.mock import Mock
from ibe_rl.view.address import Ports
from ibe_rl.view.relay import Relay
relay = Relay(Path(sys.argv[1]), Ports(int(sys.argv[2]), int(sys.argv[3])))
print(relay._process.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("viewer_hangs", [False, True])
def test_a_killed_trainer_leaves_nothing_behind(tmp_path: Path, viewer_hangs: bool) -> None:
    path, ports = tmp_path / "recording.rrd", free_ports()
    Recorder(path, TASK, "run").close()
    command = [sys.executable, "-c", TRAINER, str(path), str(ports.grpc), str(ports.web)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as trainer:
        assert trainer.stdout is not None
        relay = int(trainer.stdout.readline())
        server = server_of(relay)
        if viewer_hangs:
            os.kill(server, signal.SIGSTOP)
        trainer.kill()
    assert eventually(lambda: gone(relay))
    assert eventually(lambda: gone(server))


@pytest.mark.parametrize(
    ("choice", "desktop", "terminal", "wanted"),
    [
        ("auto", True, True, True),
        ("auto", False, True, False),
        ("auto", True, False, False),
        ("always", False, False, True),
        ("never", True, True, False),
    ],
)
def test_the_browser_is_wanted_from_a_terminal_on_a_desktop(
    choice: str, desktop: bool, terminal: bool, wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "has_desktop", lambda: desktop)
    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal, raising=False)
    assert module.wants_browser(choice) is wanted


@pytest.mark.parametrize("browser", [True, False])
def test_the_address_is_told_once_it_answers(browser: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    served: set[int] = set()
    monkeypatch.setattr(module, "is_served", served.__contains__)
    monkeypatch.setattr("webbrowser.open", opened.append)
    ports = free_ports()
    with Relay(tmp_path / "recording.rrd", ports, browser) as relay:
        served.update((ports.web, ports.grpc))
        assert relay.news() == []  # another program's page, as the relay has no recording yet
        (tmp_path / "recording.rrd").touch()
        served.clear()
        assert eventually(lambda: module.SERVES in (tmp_path / module.LOG).read_text())
        served.add(ports.web)
        assert relay.news() == []  # the page alone would show nothing
        served.add(ports.grpc)
        assert relay.wait() == [invitation(ports)]
        assert relay.news() == []
    assert opened == ([page(ports)] if browser else [])
