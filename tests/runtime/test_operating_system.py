"""Linux's way and the way of other POSIX systems, which is taken here by denying that this is Linux."""

import errno
import fcntl
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import ROOT, gone
from view_data import eventually, needed

from ibe_rl.runtime import operating_system as system

LINUX, OTHER = sys.platform, "darwin"
BOTH = pytest.mark.parametrize("name", [LINUX, OTHER])


@pytest.fixture
def name(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", request.param)
    if request.param == OTHER:
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
        monkeypatch.delattr(os, "sched_getaffinity", raising=False)


def both_ways(test: Any) -> Any:
    """Run a test as on Linux, and as where nothing of Linux is there."""
    return pytest.mark.usefixtures("name")(pytest.mark.parametrize("name", [LINUX, OTHER], indirect=True)(test))


ALONE = Path(system.__file__).parent
"""Where the module is imported in a moment, without the package."""
PARENT = """
import subprocess, sys
from operating_system import killed_with_parent
sys.platform = sys.argv[1]
nothing = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
more = nothing | {"start_new_session": True, "preexec_fn": killed_with_parent()}
made = [subprocess.Popen(sys.argv[2:], **more) for _ in range(2)]
print(*(one.pid for one in made), flush=True)
for line in sys.stdin:
    made[0].kill(), made[0].wait()
    print("ended", flush=True)
"""


@pytest.fixture
def parent() -> Iterator[Any]:
    """Start a process that starts two others, which sleep; gives it and their numbers."""
    made = []

    def start(name: str) -> tuple[subprocess.Popen[str], list[int]]:
        command = [sys.executable, "-c", PARENT, name, "sleep", "600"]
        made.append(subprocess.Popen(command, cwd=ALONE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return made[-1], [int(pid) for pid in made[-1].stdout.readline().split()]

    yield start
    for one in made:
        one.kill()
        one.communicate()


def guards_of(pids: list[int]) -> list[int]:
    return [guard for pid in pids for guard in system.children_of(pid)]


@BOTH
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_child_outlives_its_parent(parent: Any, name: str, number: int):
    process, pids = parent(name)
    guards = guards_of(pids)
    assert len(guards) == (2 if name == OTHER else 0)
    assert not any(map(gone, pids))
    process.send_signal(number)
    assert eventually(lambda: all(gone(one) for one in (*pids, *guards)))


@BOTH
def test_a_child_may_end_first_and_the_other_stays(parent: Any, name: str):
    process, pids = parent(name)
    guards = guards_of(pids)
    process.stdin.write("end\n")
    process.stdin.flush()
    assert process.stdout.readline() == "ended\n"
    assert eventually(lambda: all(gone(guard) for guard in guards[:1]))
    assert not any(map(gone, (pids[1], *guards[1:])))


def test_a_guard_ends_only_with_its_command(parent: Any):
    process, pids = parent(OTHER)
    guards = guards_of(pids)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # what a terminal may send to the group
        os.kill(guards[0], number)
    time.sleep(0.5)
    assert not any(map(gone, (*pids, *guards)))
    process.kill()
    assert eventually(lambda: all(gone(one) for one in (*pids, *guards)))


@both_ways
def test_a_command_that_is_not_there():
    with pytest.raises(FileNotFoundError):
        subprocess.Popen(["no such command"], preexec_fn=system.killed_with_parent())


@pytest.fixture
def sleeper() -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(["sleep", "600"])
    yield process
    process.kill()
    process.wait()


def test_a_stopped_process_is_told_from_a_running_one(sleeper: subprocess.Popen[bytes]):
    assert not system.is_stopped(sleeper)
    sleeper.send_signal(signal.SIGSTOP)
    assert eventually(lambda: system.is_stopped(sleeper))
    assert sleeper.poll() is None


def test_a_process_that_ends_while_it_is_asked_keeps_its_exit_status(sleeper: subprocess.Popen[bytes]):
    sleeper.send_signal(signal.SIGTERM)
    assert eventually(lambda: not system.is_stopped(sleeper) and sleeper.returncode is not None)
    assert sleeper.poll() == -signal.SIGTERM


HOLDER = """
import fcntl, sys
file = open(sys.argv[1], "w")
fcntl.FUNCTION(file, fcntl.LOCK_EX)
print("held", flush=True)
sys.stdin.read()
"""


def refuse(number: int) -> Any:
    def call(*_: Any) -> None:
        raise OSError(number, os.strerror(number))

    return call


@pytest.mark.parametrize("way", ["flock", "lockf"])
def test_a_lock_holds_until_its_process_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str):
    command = [sys.executable, "-c", HOLDER.replace("FUNCTION", way), str(tmp_path / "lock")]
    if way == "lockf":
        monkeypatch.setattr(fcntl, "flock", refuse(errno.EOPNOTSUPP))
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with (tmp_path / "lock").open("w") as file:
            assert not system.lock_file(file)
        holder.kill()
        holder.wait()
        with (tmp_path / "lock").open("w") as file:
            assert system.lock_file(file)


def test_a_disk_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fcntl, "lockf", refuse(errno.ENOLCK))
    for number in (errno.ENOLCK, errno.EIO):
        monkeypatch.setattr(fcntl, "flock", refuse(number))
        with (tmp_path / "lock").open("w") as file, pytest.raises(OSError, match=os.strerror(number)):
            system.lock_file(file)


@both_ways
def test_room_is_reserved_and_what_is_there_stays(tmp_path: Path):
    path, size = tmp_path / "file", 3_000_001
    with path.open("wb") as file:
        file.truncate(size)
        for place in (5, 4096, size - 1):
            file.seek(place)
            file.write(b"x")
    before = path.read_bytes()
    assert path.stat().st_blocks * system.BLOCK_BYTES < size
    system.reserve(path)
    assert path.stat().st_blocks * system.BLOCK_BYTES >= size
    assert path.read_bytes() == before
    system.reserve(path)  # again there is nothing to do
    assert path.read_bytes() == before


def test_a_disk_that_takes_only_a_part_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delattr(os, "posix_fallocate", raising=False)
    monkeypatch.setattr(os, "pwrite", lambda _file, piece, _place: len(piece) - 1)
    with (tmp_path / "file").open("wb") as file:
        file.truncate(1_000_000)
    with pytest.raises(OSError, match=f"No space left on device: '{tmp_path / 'file'}'"):
        system.reserve(tmp_path / "file")


@both_ways
def test_who_listens_where():
    for host, family in (("127.0.0.1", socket.AF_INET), ("0.0.0.0", socket.AF_INET)):  # noqa: S104 - both are tried
        with socket.create_server((host, 0)) as server:
            port = server.getsockname()[1]
            assert not system.can_listen(port, "127.0.0.1", family)
        assert system.can_listen(port, "127.0.0.1", family)


def test_a_server_beside_which_the_system_would_bind(monkeypatch: pytest.MonkeyPatch):
    """As BSD systems do, where that server has all addresses."""
    monkeypatch.setattr(socket.socket, "bind", lambda *_: None)
    with socket.socket() as server:
        server.listen()  # on a port that the system chooses
        port = server.getsockname()[1]
        for name, free in ((LINUX, True), (OTHER, False)):
            monkeypatch.setattr(sys, "platform", name)
            assert system.can_listen(port, "127.0.0.1", socket.AF_INET) is free


@both_ways
def test_the_machine():
    assert 1 <= system.usable_cores() <= (os.cpu_count() or 1)
    assert system.processor_name()


def test_a_processor_without_a_name(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "platform", OTHER)
    monkeypatch.setattr(system, "_output_of", lambda *command: f"{command[0]}: Apple M9\n")
    assert system.processor_name() == "sysctl: Apple M9"
    monkeypatch.setattr(system, "_output_of", lambda *_: "")
    assert system.processor_name() == os.uname().machine


def test_peak_memory_has_the_unit_of_the_system(monkeypatch: pytest.MonkeyPatch):
    here = system.peak_memory_mb()
    assert 10 < here < 10_000
    monkeypatch.setattr(sys, "platform", OTHER if LINUX == "linux" else "linux")
    assert system.peak_memory_mb() == pytest.approx(here / 1000 if LINUX == "linux" else here * 1000, rel=0.1)


@both_ways
def test_processes_and_what_they_were_started_with(sleeper: subprocess.Popen[bytes]):
    needed(shutil.which("ps") is not None, "ps")
    assert eventually(lambda: system.command_line_of(sleeper.pid) == "sleep 600")
    assert sleeper.pid in system.children_of(os.getpid())
    assert system.children_of(sleeper.pid) == []
    sleeper.kill()
    sleeper.wait()
    assert system.children_of(sleeper.pid) == []
    assert system.command_line_of(sleeper.pid) == ""


def test_windows_is_refused_in_one_line():
    for code, refused in (("import ibe_rl", True), ("import ibe_rl.storage.run_folder", True), ("", False)):
        command = [sys.executable, "-c", f"import sys; sys.platform = 'win32'; {code}"]
        ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert (ended.returncode == 1) is refused
        assert ended.stderr.count("\n") == refused
        assert ("WSL" in ended.stderr) is refused


@pytest.mark.parametrize(
    ("platform", "variables", "desktop"),
    [
        ("linux", {}, False),
        ("linux", {"DISPLAY": ":0"}, True),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, True),
        ("linux", {"DISPLAY": "localhost:10.0", "SSH_CONNECTION": "a 1 b 2"}, False),
        ("darwin", {}, True),
    ],
)
def test_a_desktop(platform: str, variables: dict[str, str], desktop: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SSH_CONNECTION"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.platform", platform)
    assert system.has_desktop() is desktop


@pytest.mark.parametrize(("platform", "method"), [("linux", "forkserver"), ("darwin", "spawn")])
def test_workers_are_copies_where_a_fork_is_safe(platform: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", platform)
    assert system.process_start_method() == method
