"""Arrays on disk take up their room at once, and come back as they were or not at all."""

import errno
import os
import re
import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ibe_rl.runtime.operating_system import reserve
from ibe_rl.storage.arrays import make_array, map_array

KIND = np.dtype(np.float32)


def test_what_was_written_comes_back(tmp_path: Path):
    array = make_array(tmp_path / "a.npy", KIND, (4, 3))
    array[1] = [1, 2, 3]
    array.flush()
    for mode in ("r", "r+"):
        np.testing.assert_array_equal(map_array(tmp_path / "a.npy", mode), [[0] * 3, [1, 2, 3], [0] * 3, [0] * 3])


def test_what_is_changed_is_changed_on_disk(tmp_path: Path):
    make_array(tmp_path / "a.npy", KIND, (4,))
    map_array(tmp_path / "a.npy", "r+")[2] = 5
    assert map_array(tmp_path / "a.npy").tolist() == [0, 0, 5, 0]
    with pytest.raises(ValueError, match="read-only"):
        map_array(tmp_path / "a.npy")[0] = 1


def test_the_room_is_taken_up_at_once(tmp_path: Path):
    """Else a full disk would kill the process in the middle of a training."""
    path = tmp_path / "a.npy"
    make_array(path, KIND, (1_000_000,))
    assert path.stat().st_blocks * 512 >= 4_000_000
    np.lib.format.open_memmap(path, mode="w+", dtype=KIND, shape=(1_000_000,))
    assert path.stat().st_blocks * 512 < 1_000_000  # as numpy makes them
    map_array(path, "r+")
    assert path.stat().st_blocks * 512 >= 4_000_000


def test_without_room_nothing_is_made(tmp_path: Path):
    path, before = tmp_path / "a.npy", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    try:
        with pytest.raises(OSError, match=f"File too large: '{path}'"):
            make_array(path, KIND, (1_000_000,))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not path.exists()


@pytest.mark.parametrize("number", [errno.EOPNOTSUPP, errno.EINVAL])
def test_a_file_system_that_cannot_tell_is_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int):
    def refuse(*_: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "posix_fallocate", refuse)
    assert len(make_array(tmp_path / "a.npy", KIND, (10,))) == 10


def test_a_disk_that_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "a.npy"
    make_array(path, KIND, (10,))[:] = 1
    monkeypatch.setattr(os, "posix_fallocate", refuse)
    for take in (reserve, lambda path: map_array(path, "r+")):
        with pytest.raises(OSError, match=f"No space left on device: '{path}'"):
            take(path)
    assert map_array(path).tolist() == [1] * 10  # what was there stays


def test_a_system_without_reservations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delattr(os, "posix_fallocate")
    assert len(make_array(tmp_path / "a.npy", KIND, (10,))) == 10


@pytest.mark.parametrize("keep", [0, 50, 129, -1])
@pytest.mark.parametrize("mode", ["r", "r+"])
def test_a_file_cut_short_is_refused_and_not_filled_up(tmp_path: Path, keep: int, mode: Any):
    path = tmp_path / "a.npy"
    make_array(path, KIND, (10,))
    path.write_bytes(path.read_bytes()[:keep])
    size = path.stat().st_size
    with pytest.raises(ValueError, match=r"^a.npy is not a readable array \(.+\)$"):
        map_array(path, mode)
    assert path.stat().st_size == size


def test_a_file_with_something_behind_its_end_is_refused(tmp_path: Path):
    path = tmp_path / "a.npy"
    make_array(path, KIND, (10,))
    with path.open("ab") as stream:
        stream.write(b"more")
    wanted = "a.npy is not a readable array (172 bytes are there, its head declares 168)"
    with pytest.raises(ValueError, match=re.escape(wanted)):
        map_array(path)


def test_a_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(ValueError, match=r"a\.npy is not a readable array"):
        map_array(tmp_path / "a.npy")
