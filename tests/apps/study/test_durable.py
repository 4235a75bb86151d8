"""What is written is kept whole, survives, and is not confirmed where the disk did not take it."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from ibe_rl.apps.study.commits import Commits
from ibe_rl.apps.study.durable import DurableStore

TABLE = "CREATE TABLE IF NOT EXISTS words (word TEXT PRIMARY KEY)"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "words.sqlite"


@pytest.fixture
def store(path: Path) -> Iterator[DurableStore]:
    one = DurableStore(path, TABLE)
    yield one
    one.close()


def write(store: DurableStore, *words: str) -> None:
    with store.transaction():
        for word in words:
            store.execute("INSERT INTO words VALUES (?)", (word,))


def on_disk(path: Path) -> list[str]:
    """What somebody else reads, who sees only what was committed."""
    other = sqlite3.connect(path)
    try:
        return [word for (word,) in other.execute("SELECT word FROM words ORDER BY word")]
    finally:
        other.close()


def test_it_is_on_disk_at_once_unless_it_may_wait(store: DurableStore, path: Path) -> None:
    write(store, "a")
    assert on_disk(path) == ["a"]
    store.commits_later = True
    write(store, "b")
    assert (on_disk(path), store.waits) == (["a"], True)
    store.commit()
    assert (on_disk(path), store.waits) == (["a", "b"], False)


@pytest.mark.parametrize("later", [False, True])
def test_a_part_that_fails_takes_nothing_of_others_with_it(store: DurableStore, path: Path, later: bool) -> None:
    store.commits_later = later
    write(store, "a")
    with pytest.raises(sqlite3.IntegrityError):
        write(store, "b", "a")
    write(store, "c")
    store.commit()
    assert on_disk(path) == ["a", "c"]


def test_what_waits_is_written_when_it_is_closed(path: Path) -> None:
    store = DurableStore(path, TABLE)
    store.commits_later = True
    write(store, "a")
    store.close()
    assert on_disk(path) == ["a"]


def test_those_who_come_together_share_a_write(store: DurableStore, path: Path) -> None:
    commits = Commits(store)
    said: list[str] = []
    store._file.set_trace_callback(said.append)

    async def come(number: int) -> None:
        write(store, f"{number:02}")
        await commits.confirmed()
        assert f"{number:02}" in on_disk(path)

    async def all_come() -> None:
        await asyncio.gather(*map(come, range(20)))
        await commits.confirmed()  # nothing waits

    asyncio.run(all_come())
    assert len(on_disk(path)) == 20
    assert said.count("COMMIT") == 1


def test_nobody_is_confirmed_what_a_full_disk_undid(store: DurableStore, path: Path) -> None:
    [pages] = store.execute("PRAGMA page_count").fetchone()
    store.execute(f"PRAGMA max_page_count = {pages + 3}")
    commits = Commits(store)

    async def come(word: str) -> None:
        write(store, word)
        await commits.confirmed()

    async def all_come() -> list[object]:
        return await asyncio.gather(come("a"), come("b" * 100_000), return_exceptions=True)

    became = asyncio.run(all_come())
    kept = on_disk(path)
    assert isinstance(became[1], sqlite3.Error)
    assert (became[0] is None) == ("a" in kept)  # confirmed if and only if it is there
    asyncio.run(come("c"))
    assert "c" in on_disk(path)


def test_a_commit_that_fails_is_told_to_all_who_wait(store: DurableStore, path: Path) -> None:
    commits = Commits(store)
    store.execute("CREATE TABLE pairs (word TEXT REFERENCES words(word) DEFERRABLE INITIALLY DEFERRED)")

    async def come(query: str) -> None:
        with store.transaction():
            store.execute(query)
        await commits.confirmed()

    async def all_come() -> list[object]:
        queries = ("INSERT INTO words VALUES ('a')", "INSERT INTO pairs VALUES ('of nobody')")
        return await asyncio.gather(*map(come, queries), return_exceptions=True)

    assert all(isinstance(one, sqlite3.IntegrityError) for one in asyncio.run(all_come()))
    assert (on_disk(path), store.waits) == ([], False)


def lose(store: DurableStore) -> None:
    with store.transaction():
        store._file.rollback()  # as SQLite does by itself on some errors
        raise RuntimeError


def test_a_lost_transaction_is_told_once(store: DurableStore, path: Path) -> None:
    store.commits_later = True
    write(store, "a")
    with pytest.raises(RuntimeError):
        lose(store)
    assert store.waits
    with pytest.raises(sqlite3.OperationalError, match="the disk did not take what was written"):
        store.commit()
    assert (on_disk(path), store.waits) == ([], False)
