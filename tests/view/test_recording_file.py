"""The file of a recording: it takes what it can, keeps whole messages, and never makes the writer wait."""

import subprocess
import sys
from io import BytesIO
from pathlib import Path

import pytest
from rerun.chunk import RrdReader
from view_data import TASK, eventually, record

from ibe_rl.view.recorder import Recorder
from ibe_rl.view.recording_file import RecordingFile, whole_messages

HEADER = b"RRF2" + bytes(8)


def message(content: bytes) -> bytes:
    return (2).to_bytes(8, "little") + len(content).to_bytes(8, "little") + content


WHOLE = HEADER + message(b"one") + message(b"number two")


def test_what_goes_in_is_in_the_file_after_draining(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a")
    file.entrance.write_bytes(WHOLE)
    file.drain()
    assert (tmp_path / "a").read_bytes() == WHOLE
    assert file.size == len(WHOLE)
    file.entrance.write_bytes(b"more")
    assert eventually(lambda: (tmp_path / "a").read_bytes() == WHOLE + b"more")  # without being asked
    file.close()
    file.close()


def test_far_more_than_a_pipe_holds_goes_in(tmp_path: Path) -> None:
    file, data = RecordingFile(tmp_path / "a"), bytes(1_000_000)
    file.entrance.write_bytes(data)
    file.close()
    assert (tmp_path / "a").read_bytes() == data


def test_the_limit_is_kept_and_whole_messages_stay(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a", max_bytes=len(WHOLE) + 3)
    for part in (WHOLE, message(b"third")[:2], message(b"third")[2:]):
        file.entrance.write_bytes(part)
        file._drain()
    file.entrance.write_bytes(bytes(1_000_000))  # nobody waits
    with pytest.raises(OSError, match=f"{len(WHOLE) + 3} bytes are reached"):
        file.drain()
    file.close()
    assert (tmp_path / "a").read_bytes() == WHOLE
    assert file.size == len(WHOLE)


def test_a_device_without_space_takes_nothing_and_hinders_nobody(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("/dev/full")
    file = RecordingFile(tmp_path / "a")
    file.entrance.write_bytes(bytes(1_000_000))
    with pytest.raises(OSError, match="No space left on device"):
        file.drain()
    file.close()


def test_a_file_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        RecordingFile(tmp_path / "no such folder" / "a")


@pytest.mark.parametrize("size", range(len(WHOLE) + 1))
def test_whole_messages_are_counted(size: int) -> None:
    ends = [0, len(HEADER), len(HEADER + message(b"one")), len(WHOLE)]
    assert whole_messages(BytesIO(WHOLE), size) == max(end for end in ends if end <= size)


def test_messages_are_framed_as_rerun_frames_them(tmp_path: Path) -> None:
    record(tmp_path / "whole.rrd")
    data = (tmp_path / "whole.rrd").read_bytes()
    chunks = [str(chunk.id) for chunk in RrdReader(str(tmp_path / "whole.rrd")).stream()]
    for share in (0.4, 0.5, 0.6):  # the footer is at the end
        end = whole_messages(BytesIO(data), int(share * len(data)))
        (tmp_path / "cut.rrd").write_bytes(data[:end])
        before = [str(chunk.id) for chunk in RrdReader(str(tmp_path / "cut.rrd")).stream()]
        assert 3 < len(before) < len(chunks)
        assert set(before) < set(chunks)


LIMITED = """
import resource, sys
from pathlib import Path
from view_data import TASK, filmed, refreshed
from ibe_rl.view.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]), TASK, "run")
size = recorder.size() + 100_000
resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
recorder.refresh(refreshed())
recorder.flush()
for call in (lambda: recorder.watched(60_000, *filmed()), recorder.flush,
             recorder.close):
    try:
        call()
    except OSError as error:
        print(error.strerror)
"""


@pytest.mark.slow
def test_rerun_never_notices_a_full_disk(tmp_path: Path) -> None:
    """Not even at the exit, where its own writer waits for ever every few times."""
    path = tmp_path / "recording.rrd"
    command = [sys.executable, "-c", LIMITED, str(path)]
    ended = subprocess.run(
        command, cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=120, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "File too large\n" * 2, "")
    entities = {str(chunk.entity_path) for chunk in RrdReader(str(path)).stream()}
    assert "/vocabulary/centres" in entities
    assert whole_messages(BytesIO(path.read_bytes()), path.stat().st_size) == path.stat().st_size


def test_a_recorder_says_that_the_disk_is_full(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("/dev/full")
    recorder = Recorder(tmp_path / "a", TASK, "run")
    for call in (recorder.size, recorder.flush, recorder.close):
        with pytest.raises(OSError, match="No space left on device"):
            call()
    recorder.close()
