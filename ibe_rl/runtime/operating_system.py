"""What Linux does in its own way, each with a way for macOS and other POSIX systems beside it.

Windows is refused where the package is imported, in ``ibe_rl/__init__.py``.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import platform
import resource
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO

PR_SET_PDEATHSIG = 1  # from Linux's prctl.h
CANNOT_RESERVE = (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)
CANNOT_LOCK = (errno.EOPNOTSUPP, errno.ENOSYS, errno.ENOLCK)
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""A full disk, a quota, a limit."""
BLOCK_BYTES = 512
"""Unit of ``st_blocks``."""
COPIED_BYTES = 1 << 20
GUARD = """
import os, select, signal, sys
command, ended = map(int, sys.argv[1:])
while os.getppid() == command:
    if select.select([ended], [], [], 0.2)[0]:
        os.kill(command, signal.SIGKILL)
        break
"""
"""A process that a command starts as its child: kills it when the pipe ``ended`` is at its end."""


def killed_with_parent() -> Callable[[], None]:
    """For ``preexec_fn``: the new process is killed when its parent ends for any reason.

    A gentler signal would arrive once per thread of the parent, and a second Ctrl-C ends a training at once.
    """
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)  # loaded before the fork
        return lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    ended = _pipe_that_ends_with(os.getpid())
    return lambda: _start_guard(ended)


@cache
def _pipe_that_ends_with(_process: int) -> int:
    """The reading end of a pipe whose other end only this process holds: the system closes it at the end."""
    return os.pipe()[0]


def _start_guard(ended: int) -> None:
    """In the child, before it becomes the command: start its guard, which holds no file but the pipe."""
    command = os.getpid()
    if os.fork():
        return
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)  # they are for the command
        os.set_inheritable(ended, True)
        os.execv(sys.executable, [sys.executable, "-IS", "-c", GUARD, str(command), str(ended)])  # noqa: S606 - our own
    finally:
        os._exit(1)


def is_stopped(process: subprocess.Popen[bytes]) -> bool:
    """True if a running process has been stopped (SIGSTOP) since it was last asked; ``waitid`` is not everywhere."""
    found, status = os.waitpid(process.pid, os.WNOHANG | os.WUNTRACED)
    if found and not os.WIFSTOPPED(status):
        process.returncode = os.waitstatus_to_exitcode(status)  # it has just ended, and nobody can ask again
    return bool(found) and os.WIFSTOPPED(status)


def lock_file(file: IO[str]) -> bool:
    """Lock an open file against other processes until it is closed; False if another holds it.

    Raises:
        OSError: if its file system has no locks.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in CANNOT_LOCK:
            raise
        return _lock_record(file)
    return True


def _lock_record(file: IO[str]) -> bool:
    """POSIX's own lock; unlike ``flock`` it does not hold within one process."""
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # POSIX allows both
        return False
    return True


def reserve(path: Path) -> None:
    """Reserve the disk space of a mapped file: on a full disk, writing to it would kill the process.

    Raises:
        OSError: if the disk is full; not on file systems that cannot reserve.
    """
    with path.open("r+b") as stream:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(stream.fileno(), 0, os.fstat(stream.fileno()).st_size)
            else:
                _fill_holes(stream.fileno())
        except OSError as error:
            if error.errno not in CANNOT_RESERVE:
                raise OSError(error.errno, error.strerror, str(path)) from None


def _fill_holes(file: int) -> None:
    """Write over a file what is there; its holes are read as zeros, and become room on the disk."""
    about = os.fstat(file)
    if about.st_blocks * BLOCK_BYTES >= about.st_size:
        return
    for place in range(0, about.st_size, COPIED_BYTES):
        piece = os.pread(file, COPIED_BYTES, place)
        if os.pwrite(file, piece, place) < len(piece):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def can_listen(port: int, host: str, family: socket.AddressFamily) -> bool:
    """True if a server could listen on this port."""
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # of a server that has just gone
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return sys.platform == "linux" or not accepts(port, host, family)


def accepts(port: int, host: str, family: socket.AddressFamily) -> bool:
    """Whether somebody listens; with SO_REUSEADDR, BSD systems also bind beside a server of all addresses."""
    with socket.socket(family) as probe:
        probe.settimeout(1.0)
        return probe.connect_ex((host, port)) == 0


def process_start_method() -> str:
    """How ``multiprocessing`` starts workers: as copies of a process that has imported much, where fork is safe."""
    return "forkserver" if sys.platform == "linux" else "spawn"


def usable_cores() -> int:
    """Number of cores that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def has_desktop() -> bool:
    """Whether a browser could open before the person who started this."""
    if "SSH_CONNECTION" in os.environ:
        return False
    return sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def processor_name() -> str:
    """What the processor is called, or else its kind."""
    if sys.platform == "linux":
        lines = _text_of(Path("/proc/cpuinfo")).splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    else:
        names = _output_of("sysctl", "-n", "machdep.cpu.brand_string").splitlines()
    return names[0] if names else platform.machine()


def peak_memory_mb() -> float:
    """The most resident memory that this process has held."""
    per_mb = 1e6 if sys.platform == "darwin" else 1e3  # bytes there, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / per_mb


def children_of(pid: int) -> list[int]:
    """The processes that a process has started and that have not been waited for."""
    if sys.platform == "linux":
        return [int(child) for child in _text_of(Path(f"/proc/{pid}/task/{pid}/children")).split()]
    pairs = [line.split() for line in _output_of("ps", "-A", "-o", "pid=", "-o", "ppid=").splitlines()]
    return [int(child) for child, parent in pairs if int(parent) == pid]


def command_line_of(pid: int) -> str:
    """What a process was started with, as one line; empty if it is gone or has ended."""
    if sys.platform == "linux":
        return _text_of(Path(f"/proc/{pid}/cmdline")).rstrip("\0").replace("\0", " ")
    return _output_of("ps", "-ww", "-o", "args=", "-p", str(pid)).rstrip("\n")


def _text_of(file: Path) -> str:
    """What a file of /proc holds; empty if its process is gone."""
    try:
        return file.read_text(errors="replace")
    except OSError:
        return ""


def _output_of(*command: str) -> str:
    """What a command prints; empty if it fails or is not there."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout  # noqa: S603 - our own
    except OSError:
        return ""
