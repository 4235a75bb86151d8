"""What users named is printed as it is, pasted into a shell it comes back, and no stream makes printing fail."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from processes import ROOT

from ibe_rl.runtime.printed import for_shell, visible

PATHS = [
    "plain",
    "a b",
    "a,b",
    "a=b",
    "(x)",
    "[a]",
    "é ü",
    "it's",
    'a"b',
    "#a",
    "$HOME",
    "~",
    "-v-",
    "%",
    "a\\b",
    "`ls`",
]
PATHS += ["a\nb", "\x1b[31mred", "tab\t'", "\udce9", "!x", "*", ""]
"""Names that a file system allows, and that a shell or a terminal takes for something else."""


@pytest.mark.parametrize("path", PATHS)
def test_a_shell_reads_the_word_back(path: str) -> None:
    line = f"printf %s {for_shell(path)}"
    assert "\n" not in line
    assert subprocess.run(["bash", "-c", line], capture_output=True, check=True).stdout == os.fsencode(path)


def test_letters_that_the_output_does_not_have_are_pasted_as_escapes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), "ascii"))
    assert for_shell("é") == "$'\\xc3\\xa9'"


def test_control_characters_are_seen_and_change_nothing() -> None:
    assert visible("a\x1b[31m\u202eb\r\n[left] :smile:") == "a\\x1b[31m\\u202eb\\r\n[left] :smile:"


def ran(code: str, redirected: str = "", **variables: str) -> subprocess.CompletedProcess[bytes]:
    """A program that prepares its output, in a shell with redirections."""
    command = (
        f"{for_shell(sys.executable)} -c {for_shell(f'from ibe_rl.runtime.printed import *; {code}')} {redirected}"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | variables
    return subprocess.run(["bash", "-c", command], env=environment, capture_output=True, check=False)


def test_letters_that_a_stream_does_not_have_are_written_as_escapes() -> None:
    done = ran("prepare_output(); print('“é”', file=sys.stderr); print('\\udce9x')", PYTHONIOENCODING="ascii:strict")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"\\udce9x\n", b"\\u201c\\xe9\\u201d\n")


@pytest.mark.parametrize("redirected", [">&-", ">&- 2>&- <&-"])
def test_a_closed_stream_takes_everything_and_its_number_is_not_given_away(tmp_path: Path, redirected: str) -> None:
    told = tmp_path / "told.json"
    code = f"prepare_output(); print(1); f = open({str(told)!r}, 'w'); json = __import__('json'); "
    code += "print(2, file=sys.stderr); json.dump(f.fileno(), f)"
    assert ran(code, redirected).returncode == 0
    assert json.loads(told.read_text()) > 2


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_program_whose_output_nobody_reads_ends_without_a_word(unbuffered: str) -> None:
    code = "prepare_output(); [print('x' * 1000, flush=True) for _ in range(10_000)]"
    done = ran(code, "| head -c 1; exit ${PIPESTATUS[0]}", PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.SIGPIPE, b"x", b"")


def test_a_program_that_hears_of_hangups_hears_of_it_and_goes_on(tmp_path: Path) -> None:
    told = tmp_path / "told"
    code = f"prepare_output(); signal.signal(signal.SIGHUP, lambda *_: open({str(told)!r}, 'a').write('!')); "
    code += "[print('x' * 1000, flush=True) for _ in range(10_000)]"
    done = ran(code, "| head -c 1; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr, told.read_text()) == (0, b"", "!")


FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device without room")


@FULL
def test_a_program_that_has_no_room_for_its_output_says_so() -> None:
    done = ran("prepare_output(); print('x'); print('y', flush=True); print('never', file=sys.stderr)", ">/dev/full")
    assert (done.returncode, done.stderr) == (1, b"error: the output cannot be written (No space left on device)\n")


@FULL
def test_a_program_that_hears_of_hangups_goes_on_where_there_is_no_room_for_its_output() -> None:
    code = "prepare_output(); signal.signal(signal.SIGHUP, lambda *_: 1 / 0); "
    code += "[print('x' * 1000, flush=True) for _ in range(100)]; print('all done', file=sys.stderr)"
    done = ran(code, ">/dev/full")
    assert (done.returncode, done.stderr) == (0, b"all done\n")
