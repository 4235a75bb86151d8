"""Curves, texts and pictures as files, without any package."""

from __future__ import annotations

from pathlib import Path

from torchrl.record.loggers import CSVLogger, Logger

from ibe_rl.apps.loggers.run_logger import FOLDER, RunLogger
from ibe_rl.storage.run_folder import write_atomically


class Csv(RunLogger):
    """One file of frames and values for each curve, in ``loggers/csv``.

    A run that goes on drops the values beyond; texts and pictures of the same frames are written again.
    """

    name = "csv"

    def open(self, folder: Path, resumed_at: int | None) -> Logger:
        """See ``RunLogger``."""
        self._folder = folder / FOLDER / self.name
        for path in (self._folder / "scalars").rglob("*.csv") if resumed_at is not None else ():
            _drop_rows_beyond(path, resumed_at or 0)
        return CSVLogger(self.name, str(folder / FOLDER))

    def place(self) -> str:
        """See ``RunLogger``."""
        return str(self._folder)

    def text(self, name: str, text: str, frames: int) -> None:
        """See ``RunLogger``."""
        self._write("texts", f"{name}_{frames:012d}.md", f"{text}\n".encode())

    def picture(self, name: str, png: bytes, frames: int) -> None:
        """See ``RunLogger``."""
        self._write("pictures", f"{name}_{frames:012d}.png", png)

    def _write(self, kind: str, name: str, content: bytes) -> None:
        path = self._folder / kind / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda stream: stream.write(content))


def _drop_rows_beyond(path: Path, frames: int) -> None:
    lines = path.read_text().splitlines(keepends=True)
    kept = [line for line in lines if line.endswith("\n") and int(line.partition(",")[0]) <= frames]
    write_atomically(path, lambda stream: stream.write("".join(kept).encode()))
