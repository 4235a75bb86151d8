"""The file of a recording: takes what rerun writes, and keeps rerun from ever meeting a full disk.

After a failed write rerun 0.41's own file writer may wait for ever, in flush and at the exit. Here it writes
into a pipe that takes everything, and a thread moves that on to the file for as long as the file takes it.
"""

from __future__ import annotations

import errno
import os
import select
from contextlib import suppress
from pathlib import Path
from struct import Struct
from threading import Event, Lock, Thread
from typing import BinaryIO

MAGIC = b"RRF2"
HEAD_BYTES = 12
MESSAGE = Struct("<QQ")
"""A recording is its head, beginning with ``MAGIC``, and messages; before each stand its kind and its length."""
END = 0
"""Kind of the message behind which only the footer follows."""
PIECE_BYTES = 1 << 18
POLL_MS = 200


class RecordingFile:
    """A file that is written through ``entrance`` until ``close``.

    Args:
        path: the file, written anew; its folder must exist.
        max_bytes: it never gets longer than this; None: no limit.

    Attributes:
        entrance: the path that rerun is to write to.
        size: bytes in the file.
        error: why the file takes nothing any more; None while it does. What it holds then are whole messages.

    Raises:
        OSError: if the file cannot be made.
    """

    def __init__(self, path: Path, max_bytes: int | None = None) -> None:
        self._path, self._max_bytes = path, max_bytes
        self._file = path.open("wb", buffering=0)
        self._pipe, self._end = os.pipe()
        os.set_blocking(self._pipe, False)
        self.entrance = Path(f"/dev/fd/{self._end}")
        self.size = 0
        self.error: OSError | None = None
        self._lock, self._closing = Lock(), Event()
        self._thread = Thread(target=self._move_on, name="recording file", daemon=True)
        self._thread.start()

    def drain(self) -> None:
        """Write to the file what is in the pipe by now.

        Raises:
            OSError: if the file takes nothing any more.
        """
        self._drain()
        if self.error is not None:
            raise self.error

    def close(self) -> None:
        """Write the rest and close the file; rerun must have closed its end. A second call does nothing."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        self._drain()
        os.close(self._end)
        os.close(self._pipe)
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error

    def _move_on(self) -> None:
        ready = select.poll()
        ready.register(self._pipe, select.POLLIN)
        while not self._closing.is_set():
            ready.poll(POLL_MS)
            self._drain()

    def _drain(self) -> None:
        with self._lock, suppress(BlockingIOError):  # it is empty
            while data := os.read(self._pipe, PIECE_BYTES):
                self._write(memoryview(data))

    def _write(self, data: memoryview) -> None:
        if self.error is not None:
            return  # taken from rerun all the same, so that it never waits
        try:
            if self._max_bytes is not None and self.size + len(data) > self._max_bytes:
                raise OSError(errno.EFBIG, f"{self._max_bytes:,} bytes are reached", str(self._path))
            while data:
                taken = self._file.write(data)
                self.size, data = self.size + taken, data[taken:]
        except OSError as error:
            self.error = error
            self._cut()

    def _cut(self) -> None:
        """Cut off the message of which only a part is there; the file could not be read with it."""
        with suppress(OSError), self._path.open("rb") as file:  # a device cannot be cut
            self.size = whole_messages(file, self.size)
            self._file.truncate(self.size)


def earlier(path: Path) -> Path:
    """Where the part of a recording lies that is to be written into it once more."""
    return path.with_suffix(".earlier.rrd")


def set_back(path: Path, size: int) -> None:
    """Keep the first ``size`` bytes of a recording, as far as they are whole messages, as its ``earlier`` part."""
    if not earlier(path).exists() and path.exists():  # or else the last one who went on with it was killed here
        with path.open("r+b") as file:
            file.truncate(whole_messages(file, min(size, os.fstat(file.fileno()).st_size)))
        path.replace(earlier(path))


def next_message(file: BinaryIO, begin: int, size: int) -> tuple[int, int] | None:
    """Kind and end of the message that begins there; None if it is not whole among the first ``size`` bytes."""
    if begin + MESSAGE.size > size:
        return None
    file.seek(begin)
    kind, length = MESSAGE.unpack(file.read(MESSAGE.size))
    end = begin + MESSAGE.size + length
    return (kind, end) if end <= size else None


def whole_messages(file: BinaryIO, size: int) -> int:
    """Count the bytes of the whole messages, and of the head, among the first ``size`` bytes of a recording."""
    end = HEAD_BYTES if size >= HEAD_BYTES else 0
    while end and (found := next_message(file, end, size)):
        end = found[1]
    return end
