"""Messages of child processes that end with an error, in files that their parent reads."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory


class ChildErrors:
    """A folder for the error messages of child processes; removed with this object."""

    def __init__(self) -> None:
        self._made = TemporaryDirectory(prefix="ibe_rl_", ignore_cleanup_errors=True)
        self.folder = Path(self._made.name)

    def first(self) -> str | None:
        """The earliest message; None if there is none."""
        said = sorted(self.folder.glob("*.txt"), key=lambda path: path.stat().st_mtime_ns)
        return said[0].read_text() if said else None


def report_error(folder: Path, message: str) -> None:
    """Write the error message of this process into the ``folder`` of its parent."""
    path = folder / f"{os.getpid()}.part"
    path.write_text(message)
    path.replace(path.with_suffix(".txt"))
