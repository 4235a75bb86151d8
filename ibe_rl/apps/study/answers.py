"""What people answered, in one SQLite file: an answer is on disk before the next page is shown.

The IDs of a recruiter lie in a table of their own, which the analysis does not read.
"""

from __future__ import annotations

import json
import secrets
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from ibe_rl.apps.study.assignment import Order
from ibe_rl.types import ConfigError

FILE = "answers.sqlite"
FINISHED, SCREENED_OUT, NO_CONSENT = "finished", "screened_out", "no_consent"
WITHDRAWN, TIMED_OUT = "withdrawn", "timed_out"
LAID_OUT = "laid_out"
"""Not begun yet: a place in a bundle, whose number and arms are given out."""
TABLES = """
CREATE TABLE IF NOT EXISTS people (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    token TEXT NOT NULL UNIQUE,
    arms TEXT NOT NULL,
    protocol TEXT NOT NULL,
    pilot INTEGER NOT NULL,
    begun_at TEXT NOT NULL,
    last_at TEXT NOT NULL,
    ended TEXT
);
CREATE TABLE IF NOT EXISTS recruits (
    person INTEGER NOT NULL REFERENCES people(number) ON DELETE CASCADE,
    recruiter TEXT NOT NULL,
    id TEXT NOT NULL,
    fields TEXT NOT NULL,
    UNIQUE (recruiter, id)
);
CREATE TABLE IF NOT EXISTS answers (
    person INTEGER NOT NULL REFERENCES people(number) ON DELETE CASCADE,
    page TEXT NOT NULL,
    attempt INTEGER NOT NULL,
    value TEXT NOT NULL,
    took_ms INTEGER NOT NULL,
    hidden_ms INTEGER NOT NULL,
    at TEXT NOT NULL,
    protocol TEXT NOT NULL,
    PRIMARY KEY (person, page, attempt)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS switches (name TEXT PRIMARY KEY, value TEXT NOT NULL);
"""
RECRUITING, ON, OFF = "recruiting", "on", "off"
TOKEN_BYTES = 24
BUSY_S = 10.0


@dataclass(frozen=True)
class Person:
    """Somebody who takes part.

    Attributes:
        number: counts from 1; what the analysis calls them.
        token: the secret in their address.
        arms: in the order of their blocks.
        protocol: hash of the study that they began.
        pilot: not a real participant.
        ended: how they left; None while under way, ``LAID_OUT`` before.
    """

    number: int
    token: str
    arms: Order
    protocol: str
    pilot: bool
    ended: str | None


@dataclass(frozen=True)
class Answer:
    """An answer to a page.

    Attributes:
        page: its name.
        attempt: from 1; above it only where a page may be repeated.
        value: JSON object.
        took_ms: from the page's appearance, or from the end of a trial's recording, to the answer.
        hidden_ms: how long of this another window hid it.
    """

    page: str
    attempt: int
    value: dict[str, Any]
    took_ms: int
    hidden_ms: int


class Answers:
    """The answers of a study; one thread uses it.

    Args:
        path: of the file; made if it is not there.

    Raises:
        ConfigError: if it cannot be opened or is no such file.
    """

    def __init__(self, path: Path):
        try:
            self._store = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            self._store.execute("PRAGMA journal_mode=WAL")
            self._store.execute("PRAGMA synchronous=FULL")  # survives a power cut, not only a killed server
            self._store.execute("PRAGMA foreign_keys=ON")
            self._store.execute("PRAGMA secure_delete=ON")  # who withdraws is gone from the file as well
            self._store.executescript(TABLES)
        except sqlite3.Error as error:
            raise ConfigError(f"{path}: allowed is the file that holds a study's answers ({error})") from None

    def close(self) -> None:
        """Close the file."""
        self._store.close()

    def begin(
        self, arms: Order, protocol: str, pilot: bool, recruiter: str = "", external: str = "", fields: Any = None
    ) -> Person:
        """Add somebody.

        Args:
            arms: that they get.
            protocol: hash of the study.
            pilot: not a real participant.
            recruiter: who sent them; empty for nobody.
            external: their ID there; one participation for each.
            fields: what else the recruiter needs back.

        Raises:
            sqlite3.IntegrityError: if this ID takes part already; ask ``of_recruit`` before.
        """
        token, now = secrets.token_urlsafe(TOKEN_BYTES), _now()
        with self.transaction():
            row = self._store.execute(
                "INSERT INTO people (token, arms, protocol, pilot, begun_at, last_at) VALUES (?, ?, ?, ?, ?, ?)",
                (token, json.dumps(arms), protocol, pilot, now, now),
            )
            number = row.lastrowid
            assert number is not None
            if recruiter:
                self._store.execute(
                    "INSERT INTO recruits VALUES (?, ?, ?, ?)", (number, recruiter, external, json.dumps(fields or {}))
                )
        return Person(number, token, tuple(arms), protocol, pilot, None)

    def person(self, token: str) -> Person | None:
        """Who has this secret; None if nobody."""
        return self._one("WHERE token = ?", token)

    def of_recruit(self, recruiter: str, external: str) -> Person | None:
        """Who takes part under an ID of a recruiter; None if nobody."""
        return self._one(
            "WHERE number = (SELECT person FROM recruits WHERE recruiter = ? AND id = ?)", recruiter, external
        )

    def recruit_fields(self, person: Person) -> dict[str, Any]:
        """What the recruiter needs back; empty if nobody sent them."""
        row = self._store.execute("SELECT fields FROM recruits WHERE person = ?", (person.number,)).fetchone()
        return dict(json.loads(row[0])) if row else {}

    def keep(self, person: Person, answer: Answer, ended: str | None = None) -> bool:
        """Write an answer; on disk when this returns, together with what it does to the person.

        Args:
            person: under way, not begun, or given up; these are under way from now on.
            answer: to a page.
            ended: how the person leaves with it; None if they go on.

        Returns:
            False if this attempt at the page was answered before; the first answer stays.
        """
        with self.transaction():
            row = self._store.execute(
                "INSERT OR IGNORE INTO answers VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    person.number,
                    answer.page,
                    answer.attempt,
                    json.dumps(answer.value, allow_nan=False),
                    answer.took_ms,
                    answer.hidden_ms,
                    _now(),
                    person.protocol,
                ),
            )
            if row.rowcount:
                self._store.execute(
                    "UPDATE people SET last_at = ?, ended = ? WHERE number = ? AND (ended IS NULL OR ended IN (?, ?))",
                    (_now(), ended, person.number, TIMED_OUT, LAID_OUT),
                )
        return row.rowcount == 1

    def answers_of(self, person: Person) -> list[Answer]:
        """A person's answers in the order in which they came."""
        rows = self._store.execute(
            "SELECT page, attempt, value, took_ms, hidden_ms FROM answers WHERE person = ? ORDER BY at, page, attempt",
            (person.number,),
        )
        return [Answer(page, attempt, json.loads(value), took, hidden) for page, attempt, value, took, hidden in rows]

    def end(self, person: Person, how: str) -> None:
        """Note how somebody left; what is noted first stays."""
        with self.transaction():
            self._store.execute(
                "UPDATE people SET ended = ?, last_at = ? WHERE number = ? AND ended IS NULL",
                (how, _now(), person.number),
            )

    def withdraw(self, person: Person) -> None:
        """Delete a person's answers and the recruiter's ID; that somebody withdrew stays, as a count."""
        with self.transaction():
            self._store.execute("DELETE FROM answers WHERE person = ?", (person.number,))
            self._store.execute("DELETE FROM recruits WHERE person = ?", (person.number,))
            self._store.execute(
                "UPDATE people SET ended = ?, token = ? WHERE number = ?",
                (WITHDRAWN, secrets.token_urlsafe(TOKEN_BYTES), person.number),
            )
        self._store.execute("PRAGMA wal_checkpoint(TRUNCATE)")  # the journal still has the pages as they were

    def release(self, after_minutes: float) -> int:
        """Give back the places of people who have not answered for so long; returns how many."""
        limit = (datetime.now(UTC) - timedelta(minutes=after_minutes)).isoformat(timespec="milliseconds")
        with self.transaction():
            row = self._store.execute(
                "UPDATE people SET ended = ? WHERE ended IS NULL AND last_at < ?", (TIMED_OUT, limit)
            )
        return row.rowcount

    def people(self, pilots: bool = False, laid_out: bool = False) -> list[Person]:
        """All who have begun; the pilots, and the places of a bundle that nobody has taken, if they are asked for."""
        everybody = map(_person, self._store.execute(f"{_PERSON} ORDER BY number"))
        return [one for one in everybody if (pilots or not one.pilot) and (laid_out or one.ended != LAID_OUT)]

    def held(self, pilots: bool) -> tuple[Sequence[Order], Sequence[Order]]:
        """The arms of the people, or of the pilots, who have finished, and of those who may still finish."""
        people = [one for one in self.people(pilots=True, laid_out=True) if one.pilot == pilots]
        finished = [one.arms for one in people if one.ended == FINISHED]
        return finished, [one.arms for one in people if one.ended in (None, LAID_OUT)]

    def newest_pages(self) -> dict[int, str]:
        """The page that each person answered last, by their number."""
        rows = self._store.execute("SELECT person, page, max(at) FROM answers GROUP BY person")
        return {person: page for person, page, _ in rows}

    @property
    def recruiting(self) -> bool:
        """Whether new people are let in; outlives the server."""
        row = self._store.execute("SELECT value FROM switches WHERE name = ?", (RECRUITING,)).fetchone()
        return row is None or row[0] == ON

    @recruiting.setter
    def recruiting(self, wanted: bool) -> None:
        with self.transaction():
            self._store.execute("INSERT OR REPLACE INTO switches VALUES (?, ?)", (RECRUITING, ON if wanted else OFF))

    def begun(self) -> bool:
        """Whether anybody who counts has begun, or may begin by a bundle."""
        return self._store.execute("SELECT 1 FROM people WHERE pilot = 0 LIMIT 1").fetchone() is not None

    def _one(self, where: str, *values: str) -> Person | None:
        row = self._store.execute(f"{_PERSON} {where}", values).fetchone()
        return _person(row) if row else None

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all or nothing, on disk when it is left; one inside another is on disk with the outer one."""
        inside = self._store.in_transaction
        self._store.execute("SAVEPOINT inner" if inside else "BEGIN IMMEDIATE")
        try:
            yield
            self._store.execute("RELEASE inner" if inside else "COMMIT")
        except BaseException:
            if self._store.in_transaction:  # a disk that is full may have ended it
                self._store.execute("ROLLBACK TO inner" if inside else "ROLLBACK")
            raise


_PERSON = "SELECT number, token, arms, protocol, pilot, ended FROM people"


def _person(row: Sequence[Any]) -> Person:
    number, token, arms, protocol, pilot, ended = row
    return Person(number, token, tuple(json.loads(arms)), protocol, bool(pilot), ended)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
