"""The lock of a run folder: one process at a time fills it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ibe_rl.runtime.operating_system import lock_file
from ibe_rl.types import ConfigError

LOCK = ".hydra/lock"


@contextmanager
def hold_folder(path: Path, refusal: str | None = None) -> Iterator[None]:
    """Lock a run's folder against other processes; the system releases it whenever the process ends.

    Args:
        path: of the folder.
        refusal: what to say if another process holds it; None: that it is training.

    Raises:
        ConfigError: if another process holds it, or its disk has no locks.
    """
    try:
        lock = (path / LOCK).open("w")
    except OSError as error:
        raise ConfigError(f"run_dir={path}: allowed is a folder that can be written to ({error.strerror})") from None
    with lock:
        try:
            locked = lock_file(lock)
        except OSError as error:
            allowed = f"allowed is a folder on a disk that can lock files ({error.strerror})"
            raise ConfigError(f"run_dir={path}: {allowed}") from None
        if not locked:
            raise ConfigError(refusal or f"resume={path}: it is training; allowed is a run that has ended")
        yield
