"""A simulated person who sends what the page would send, without a browser."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass, field
from typing import Any

from aiohttp import ClientError, ClientSession, TCPConnector

from ibe_rl.apps.study.answers import Answer
from ibe_rl.apps.study.schedule import Page
from ibe_rl.apps.study.ways import Door, Shown
from ibe_rl.types import ConfigError

AGAIN_S = 0.05
SERVER_AWAY_S = 60.0
"""How long a server may be away."""


@dataclass
class ByMessages:
    """Takes part by HTTP; see ``ways.Way``. What gets no reply is sent again, as the page does.

    Attributes:
        session: of aiohttp.
        address: of the server.
        parameters: of the address under which the person comes.
        times_faster: than a person; the pauses before answers are shorter by this. Infinite: no pauses.
        confirmation_s: how long each answer took to be confirmed.
    """

    session: ClientSession
    address: str
    parameters: dict[str, str]
    times_faster: float = float("inf")
    confirmation_s: list[float] = field(default_factory=list)
    _path: str = ""

    @property
    def token(self) -> str:
        """The secret in the person's address."""
        return self._path.rpartition("/")[2]

    async def begin(self) -> Shown:
        """Take part; returns the first page.

        Raises:
            ConfigError: if there is no server, or it lets nobody in.
        """
        reply = await self._ask("/begin", self.parameters)
        if "address" not in reply:
            raise ConfigError(f"address={self.address}: lets nobody in ({reply.get('refused', reply)})")
        self._path = reply["address"]
        return await self.reload()

    async def reload(self) -> Shown:
        """Ask anew where the person is."""
        return await self._ask(f"{self._path}/now")

    async def give(self, shown: Shown, page: Page, value: dict[str, Any], took_s: float) -> tuple[Answer, Shown]:
        """Send an answer until there is a reply."""
        await asyncio.sleep(took_s / self.times_faster)
        sent = Answer(page.name, shown["attempt"], value, round(1000 * took_s), 0)
        begun = time.perf_counter()
        reply = await self._ask(f"{self._path}/answer", asdict(sent))
        self.confirmation_s.append(time.perf_counter() - begun)
        return sent, reply

    async def _ask(self, path: str, body: Any = None) -> dict[str, Any]:
        end = time.monotonic() + SERVER_AWAY_S
        while True:
            try:
                async with self.session.request(
                    "GET" if body is None else "POST", self.address + path, json=body
                ) as reply:
                    if reply.status < 500 and reply.content_type == "application/json":
                        return dict(await reply.json())
                    said = f"status {reply.status}"
            except (ClientError, TimeoutError, ConnectionError) as error:
                said = str(error) or type(error).__name__
            if time.monotonic() > end:
                raise ConfigError(f"address={self.address}: no study answers there, for {SERVER_AWAY_S:.0f} s ({said})")
            await asyncio.sleep(AGAIN_S)


@asynccontextmanager
async def message_door(
    address: str, parameters: Callable[[], dict[str, str]], times_faster: float, confirmation_s: list[float]
) -> AsyncIterator[Door]:
    """Connections to a server, one a person.

    Args:
        address: of the study.
        parameters: of the address for one more person.
        times_faster: than people.
        confirmation_s: filled with how long each answer took to be confirmed.
    """
    async with ClientSession(connector=TCPConnector(limit=0)) as session:

        @asynccontextmanager
        async def enter(_: int) -> AsyncIterator[ByMessages]:
            yield ByMessages(session, address, parameters(), times_faster, confirmation_s)

        yield enter
