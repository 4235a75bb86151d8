"""A simulated person who uses the real page in a headless browser, whose clock runs as fast as it can."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from ibe_rl.apps.study.answers import Answer
from ibe_rl.apps.study.schedule import COMMENT, CONSENT, TRIAL, Page
from ibe_rl.apps.study.ways import Door, Shown
from ibe_rl.config.error_line import one_line
from ibe_rl.types import ConfigError

if TYPE_CHECKING:
    from playwright.async_api import Browser, Locator
    from playwright.async_api import Page as Tab

EXTRA = "study-pilot"
ALLOWED_BROWSER = "allowed is the path of a Chromium; `python -m playwright install chromium` gets one"
ON_PATH = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
BROWSER_FLAGS = ("--disable-gpu", "--disable-background-networking", "--disable-quic", "--no-first-run")
PATIENCE_MS = 60_000.0
STEP_MS, MOST_STEPS = 500, 400
"""Of the page's clock, while an episode plays."""
KEY_STEP = 0.01
POINTER, TOUCH, KEYBOARD = "pointer", "touch", "keys"
SCREENS: tuple[tuple[str, dict[str, Any]], ...] = (
    (POINTER, {"viewport": {"width": 1280, "height": 800}}),
    (TOUCH, {"viewport": {"width": 360, "height": 740}, "has_touch": True, "device_scale_factor": 2}),
    (KEYBOARD, {"viewport": {"width": 1920, "height": 1080}}),
)
"""How people point, and the screens they have; one after the other."""


@asynccontextmanager
async def browsing(chromium: str = "") -> AsyncIterator[Browser]:
    """A headless browser.

    Args:
        chromium: its path; empty for one on the path, or the one that Playwright brings.

    Raises:
        ConfigError: if Playwright or a browser is missing, with the way to get it, or does not start.
    """
    if find_spec("playwright") is None:
        raise ConfigError(
            f"through=page: needs the package playwright; pip install 'ibe_rl[{EXTRA}]', or through=protocol"
        )
    from playwright.async_api import Error, async_playwright

    async with async_playwright() as playwright:
        path = find_chromium(chromium, playwright.chromium.executable_path)
        root = hasattr(os, "geteuid") and os.geteuid() == 0  # whose browsers have no sandbox
        flags = [*BROWSER_FLAGS, *(["--no-sandbox"] if root else [])]
        try:
            browser = await playwright.chromium.launch(executable_path=path, args=flags)
        except Error as error:
            raise ConfigError(f"chromium={path}: does not start ({one_line(error)[:200]}); {ALLOWED_BROWSER}") from None
        try:
            yield browser
        finally:
            await browser.close()


def find_chromium(asked: str, bundled: str) -> str:
    """The path of a browser.

    Args:
        asked: path of the setting; empty to look for one.
        bundled: path of the one that Playwright can install.

    Raises:
        ConfigError: if there is none.
    """
    if asked:
        if not shutil.which(asked):
            raise ConfigError(f"chromium={asked}: no program is there; {ALLOWED_BROWSER}")
        return asked
    found = [path for name in ON_PATH if (path := shutil.which(name))]
    if not found and not Path(bundled).is_file():
        raise ConfigError(
            f"chromium=: none of {', '.join(ON_PATH)} is on the path; {ALLOWED_BROWSER}, or through=protocol"
        )
    return found[0] if found else bundled


@dataclass
class ByPage:
    """Takes part by clicks, taps and keys; see ``ways.Way``.

    Attributes:
        tab: of the browser, with a clock that can be set forward.
        address: of the study.
        parameters: of the address under which the person comes.
        points: ``POINTER``, ``TOUCH`` or ``KEYBOARD``.
    """

    tab: Tab
    address: str
    parameters: dict[str, str]
    points: str = POINTER

    @property
    def token(self) -> str:
        """The secret in the person's address."""
        return self.tab.url.rpartition("/")[2]

    async def begin(self) -> Shown:
        """Open the study's address and let the person in by the button."""
        await self.tab.goto(f"{self.address}/?{urlencode(self.parameters)}")
        async with self.tab.expect_response(_is_now) as reply:
            await self._press("#begin")
        return dict(await (await reply.value).json())

    async def reload(self) -> Shown:
        """Reload the page."""
        async with self.tab.expect_response(_is_now) as reply:
            await self.tab.reload()
        return dict(await (await reply.value).json())

    async def give(self, shown: Shown, page: Page, value: dict[str, Any], took_s: float) -> tuple[Answer, Shown]:
        """Fill in what is shown, let the page's clock run as long as the person would need, and press the button."""
        here = f'body[data-page="{page.name}"][data-attempt="{shown["attempt"]}"]'
        await self.tab.locator(here).wait_for()
        if page.kind == TRIAL:
            await self._press("#play")
            await self._run_until("body[data-phase=asked]")
        await self.tab.clock.fast_forward(round(1000 * took_s))
        await self._fill(page, value)
        async with self.tab.expect_response(_is_answer) as sent:
            await self._press("#agree" if page.kind == CONSENT else "#next")
        response = await sent.value
        reply = dict(await response.json())
        if reply.get("feedback"):
            await self._run_until("#feedback ~ .buttons #next:focus")
            await self._press("#next")
        return Answer(**json.loads(response.request.post_data or "{}")), reply

    async def _run_until(self, selector: str) -> None:
        """Let the page's clock run, while an episode plays, until something is there."""
        for _ in range(MOST_STEPS):
            await self.tab.clock.run_for(STEP_MS)
            if await self.tab.locator(selector).count():
                return
        raise RuntimeError(f"an episode played longer than {MOST_STEPS * STEP_MS / 1000:.0f} s")

    async def _fill(self, page: Page, value: dict[str, Any]) -> None:
        if page.kind == COMMENT:
            await self.tab.locator("#comment").fill(value["text"])
        if "at" in value:
            await self._put(self.tab.locator("#place"), value["at"])
        for place, choice in enumerate(value.get("choices", [value["choice"]] if "choice" in value else [])):
            await self._choose(self.tab.locator(".question").nth(place), choice)
        if "confidence" in value:
            await self.tab.locator("#confidence").fill(str(value["confidence"]))

    async def _choose(self, question: Locator, choice: int | str | None) -> None:
        if choice is None:
            return
        radio = question.locator(f'input[type=radio][value="{choice}"]')
        if isinstance(choice, str) or not await radio.count():
            await question.locator("input").fill(str(choice))  # a text, or a slider where the options are many
        elif self.points == KEYBOARD:
            await radio.press(" ")
        else:
            await radio.check()

    async def _put(self, canvas: Locator, at: float) -> None:
        if self.points == KEYBOARD:
            steps = round((at - 0.5) / KEY_STEP)
            tens, ones = divmod(abs(steps), 10)
            up = steps > 0
            keys = ["PageUp" if up else "PageDown"] * tens + ["ArrowRight" if up else "ArrowLeft"] * ones
            for key in keys or ["ArrowLeft", "ArrowRight"]:  # the mark is there after the first key
                await canvas.press(key)
            return
        box = await canvas.bounding_box()
        assert box is not None, "it was waited for"
        spot: Any = {"x": min(at * box["width"], box["width"] - 1), "y": box["height"] / 2}
        await (canvas.tap(position=spot) if self.points == TOUCH else canvas.click(position=spot))

    async def _press(self, selector: str) -> None:
        button = self.tab.locator(selector)
        if self.points == KEYBOARD:
            await button.press("Enter")
        else:
            await (button.tap() if self.points == TOUCH else button.click())


@asynccontextmanager
async def page_door(address: str, parameters: Callable[[], dict[str, str]], chromium: str = "") -> AsyncIterator[Door]:
    """A browser in which each person has a window with a clock of its own; every third one points in another way.

    Args:
        address: of the study.
        parameters: of the address for one more person.
        chromium: see ``browsing``.
    """
    async with browsing(chromium) as browser:

        @asynccontextmanager
        async def enter(number: int) -> AsyncIterator[ByPage]:
            points, screen = SCREENS[number % len(SCREENS)]
            async with await browser.new_context(**screen) as context:
                context.set_default_timeout(PATIENCE_MS)
                await context.clock.install()
                yield ByPage(await context.new_page(), address, parameters(), points)

        yield enter


def _is_now(response: Any) -> bool:
    return bool(response.url.endswith("/now"))


def _is_answer(response: Any) -> bool:
    return bool(response.url.endswith("/answer") and response.status < 500)
