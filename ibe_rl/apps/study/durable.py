"""An SQLite file whose content survives a killed process and a power cut."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

BUSY_S = 10.0


class DurableStore:
    """Tables in a file; one thread uses it.

    Args:
        path: of the file; made if it is not there.
        tables: SQL that makes the tables.

    Attributes:
        commits_later: what is written is on disk only after ``commit``, so that several may share one write.

    Raises:
        sqlite3.Error: if it cannot be opened or is no such file.
    """

    def __init__(self, path: Path, tables: str):
        self.commits_later = False
        self._lost = False
        self._file = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
        self._file.execute("PRAGMA journal_mode=WAL")
        self._file.execute("PRAGMA synchronous=FULL")  # survives a power cut, not only a killed server
        self._file.execute("PRAGMA foreign_keys=ON")
        self._file.execute("PRAGMA secure_delete=ON")  # what is deleted is gone from the file as well
        self._file.executescript(tables)

    def execute(self, query: str, values: tuple[Any, ...] = ()) -> sqlite3.Cursor:
        """Run a query."""
        return self._file.execute(query, values)

    @property
    def waits(self) -> bool:
        """Whether something written is not on disk yet."""
        return self._file.in_transaction or self._lost

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """What is written inside is kept whole or not at all."""
        if not self._file.in_transaction:
            self.execute("BEGIN IMMEDIATE")
        self.execute("SAVEPOINT this")
        try:
            yield
        except BaseException:
            self._undo()
            raise
        self.execute("RELEASE this")
        if not self.commits_later:
            self.commit()

    def _undo(self) -> None:
        """Undo the newest part; a full disk undoes all that waits."""
        if self._file.in_transaction:
            self.execute("ROLLBACK TO this")
            self.execute("RELEASE this")
            if not self.commits_later:
                self.execute("ROLLBACK")
        elif self.commits_later:
            self._lost = True

    def commit(self) -> None:
        """Put on disk what was written; nothing of it is kept if that fails.

        Raises:
            sqlite3.Error: if the disk does not take it.
        """
        if self._lost:
            self._lost = False
            with suppress(sqlite3.Error):
                self.execute("ROLLBACK")
            raise sqlite3.OperationalError("the disk did not take what was written")
        if not self.waits:
            return
        try:
            self.execute("COMMIT")
        except sqlite3.Error:
            with suppress(sqlite3.Error):  # it may have been undone already
                self.execute("ROLLBACK")
            raise

    def forget(self) -> None:
        """Remove what was deleted from the journal too, which still has the pages as they were."""
        self.commit()
        self.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def close(self) -> None:
        """Close the file; what was written is on disk."""
        self.commit()
        self._file.close()
