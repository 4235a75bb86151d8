"""Answers that come at the same time are put on disk with one write, and confirmed after it."""

from __future__ import annotations

import asyncio

from ibe_rl.apps.study.durable import DurableStore


class Commits:
    """Commits what was written since the last time, once all requests at hand were taken in.

    A disk needs milliseconds for a write; two hundred people who answer within a second would wait for each other.

    Args:
        store: that is committed; from now on nothing else commits it.
    """

    def __init__(self, store: DurableStore):
        self._store = store
        self._next: asyncio.Future[None] | None = None
        store.commits_later = True

    async def confirmed(self) -> None:
        """Wait until all that was written before is on disk.

        Raises:
            sqlite3.Error: if the disk does not take it; nothing of it is kept.
        """
        if not self._store.waits:
            return
        if self._next is None:
            loop = asyncio.get_running_loop()
            self._next = loop.create_future()
            loop.call_soon(self._commit, self._next)
        await asyncio.shield(self._next)

    def _commit(self, waited: asyncio.Future[None]) -> None:
        self._next = None
        try:
            self._store.commit()
        except Exception as error:
            waited.set_exception(error)
        else:
            waited.set_result(None)
