"""How simulated people reach the server of a study: each way does what a person does in front of the pages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Any, Protocol

from ibe_rl.apps.study.answers import Answer
from ibe_rl.apps.study.schedule import Page

Shown = Mapping[str, Any]
"""What the server says that a person sees now: a page, or how they left."""


class Way(Protocol):
    """How a simulated person reaches the server: by the page in a browser, or by its messages alone."""

    async def begin(self) -> Shown:
        """Take part; returns the first page."""

    async def reload(self) -> Shown:
        """Open the page anew."""

    async def give(self, shown: Shown, page: Page, value: dict[str, Any], took_s: float) -> tuple[Answer, Shown]:
        """Answer the page that is shown; returns what was sent, and the server's reply to it."""

    @property
    def token(self) -> str:
        """The secret in the person's address."""


Door = Callable[[int], AbstractAsyncContextManager[Way]]
"""Lets the person of a number, from 0, in."""
