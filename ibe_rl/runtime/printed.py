"""What is printed: texts of users as they are, into any terminal, file or pipe."""

from __future__ import annotations

import errno
import os
import re
import shlex
import signal
import sys
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import Any, TextIO

from ibe_rl.runtime.operating_system import NO_ROOM

_ENDED_BY_PIPE = 128 + signal.SIGPIPE
"""Exit status, as a shell has it, of a program whose output nobody reads any more."""
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""What moves the cursor, colours the terminal or turns the direction of writing; a new line does not."""


def visible(text: str) -> str:
    r"""A text with its control characters as escapes, such as ``\x1b``."""
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def raised(error: Exception) -> str:
    """A short description of an error from user code."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def for_shell(word: str) -> str:
    """A word that a shell reads as it is, on one line and in letters that the output has; some only bash reads."""
    if word.isprintable() and _can_be_printed(word):
        return shlex.quote(word)
    letters = (chr(byte) if 32 <= byte < 127 else f"\\x{byte:02x}" for byte in os.fsencode(word))
    return "$'" + "".join(f"\\{one}" if one in "'\\" else one for one in letters) + "'"


def _can_be_printed(word: str) -> bool:
    try:
        word.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def prepare_output() -> None:
    """Let printing never fail for what a stream cannot take: a closed stream, or letters that it does not have."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which otherwise the next file would have
    sys.stdout, sys.stderr = _lasting(sys.stdout, 1), _lasting(sys.stderr, 2)


def _lasting(stream: TextIO | None, number: int) -> TextIO:
    if stream is None:
        return Path(os.devnull).open("w", encoding="utf-8")  # by now another file may have its number
    if type(stream) is not TextIOWrapper or stream.fileno() != number:
        return stream  # of another program, such as pytest or a notebook
    stream.flush()
    through: Any = _Lasting(number, "w", closefd=False)
    through = BufferedWriter(through) if isinstance(stream.buffer, BufferedWriter) else through  # python -u has none
    at_once = stream.line_buffering, stream.write_through
    return TextIOWrapper(through, stream.encoding, "backslashreplace", None, *at_once)


class _Lasting(FileIO):
    """A standard stream that goes on into nothing when its reader or its terminal is gone, or its disk is full.

    A training is told of the first two as by a closed terminal, so that it stops in order, and goes on where there is
    no room for its words; any other program ends.
    """

    def write(self, data: Any) -> int:
        """See ``FileIO``."""
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.EIO, *NO_ROOM):
                raise
            full = error.errno in NO_ROOM
            status = f"error: the output cannot be written ({error.strerror})" if full else _ENDED_BY_PIPE
        if signal.getsignal(signal.SIGHUP) == signal.SIG_DFL:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            raise SystemExit(status)
        if not full:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            signal.raise_signal(signal.SIGHUP)
        return len(data)
